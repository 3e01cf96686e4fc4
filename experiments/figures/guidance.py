"""Figures of a tool that is led by hand within virtual fixtures: modes, distances, energy."""

import numpy as np
from matplotlib.axes import Axes

from experiments.figures.forces import shade_pushes
from experiments.results.guidance import slots_of
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.fixtures.record import SLOT
from reporting.style import (
    COLOURS,
    INK,
    REFERENCE,
    Drawing,
    draw_components,
    make_panels,
    place_legend,
)

MILLI = 1e3
FAR = 0.03  # m, distances above which nobody needs to see
CLOSE = 3e-4  # m, of the enlargement
MOST_NAMED = 6  # regions with an entry in a legend


def has_regions(log: RunLog) -> bool:
    """Whether the log is that of a tool that regions may hold."""
    return log["region_distance"].dim > 0


def draw_guidance(log: RunLog) -> Drawing:
    """Mode, distance from the regions that were near, enlarged, and the speed."""
    canvas, (mode, distance, close, speed) = make_panels(4)
    _draw_mode(mode, log)
    values, names = _near_distances(log)
    for panel in (distance, close):
        panel.axhline(0.0, color=REFERENCE, linewidth=0.8)
        for k, (column, name) in enumerate(zip(values.T, names, strict=True)):
            label = name if k < MOST_NAMED else None
            panel.plot(log.time, MILLI * column, color=COLOURS[k % len(COLOURS)], label=label)
        panel.set(ylabel="distance in mm")
    distance.set(title="Distance from the regions", ylim=(-0.05 * MILLI * FAR, MILLI * FAR))
    close.set(title="The same, close by", ylim=(-MILLI * CLOSE, MILLI * CLOSE))
    command = np.linalg.norm(log["velocity_command"].values, axis=1)
    speed.plot(log.time, command, color=COLOURS[0])
    speed.set(title="Speed that is asked of the tool", ylabel="speed in m/s")
    shade_pushes([distance], log)
    place_legend(distance)
    caption = (
        "What the tool is led along; how far it truly is from the regions, negative inside; "
        "and how fast it is asked to move."
    )
    return Drawing("guidance", "Guidance within fixtures", caption, canvas)


def _draw_mode(panel: Axes, log: RunLog) -> None:
    names = log["mode"].labels
    panel.step(log.time, log["mode"].values[:, 0], where="post", color=COLOURS[0])
    panel.set(title="Mode", yticks=range(len(names)), ylim=(-0.3, len(names) - 0.7))
    panel.set_yticklabels(names)


def _near_distances(log: RunLog) -> tuple[FloatArray, list[str]]:
    """Return the distances of regions that were near [m], the closest first, and their names."""
    values, names = log["region_distance"].values, log["region_distance"].labels
    least = np.nanmin(values, axis=0, initial=np.inf)
    shown = [i for i in np.argsort(least) if least[i] < FAR]
    return values[:, shown], [names[i] for i in shown]


def draw_contact(log: RunLog) -> Drawing:
    """The longest way along one surface: tangential and transversal coordinates, and forces."""
    rows, region = _longest_contact(log)
    canvas, (tangential, transversal, force) = make_panels(3)
    time = log.time[rows]
    slot = slots_of(log, region)
    n, phi = slot["n"][rows], slot["phi"][rows]
    coordinates = _along(log["y_t"].values[rows], n)
    draw_components(tangential, time, coordinates, [r"$\eta_{1,1}$", r"$\eta_{1,2}$"])
    tangential.set(title="Tangential coordinates", ylabel="way in m")
    xi = log["region_distance"].values[rows, region]
    transversal.axhline(0.0, color=REFERENCE, linewidth=0.8)
    transversal.plot(time, MILLI * xi, color=COLOURS[0], label=r"$\xi_1$")
    transversal.set(title="Transversal coordinate, negative inside", ylabel="distance in mm")
    f = log["guiding_force"].values[rows]
    pressing = -np.sum(f * n, axis=1)
    force.plot(time, phi, color=COLOURS[1], label=r"of the fixture $\varphi$")
    force.plot(time, pressing, "--", color=INK, label="of the hand, into it")
    force.plot(
        time, np.linalg.norm(f + pressing[:, None] * n, axis=1), color=COLOURS[2], label="along it"
    )
    force.set(title="Forces", ylabel="force in N")
    for panel in (tangential, transversal, force):
        place_legend(panel)
    name = log["region_distance"].labels[region]
    caption = f"The longest way along one surface, {name}."
    return Drawing("contact", "Along a surface", caption, canvas)


def has_contact(log: RunLog) -> bool:
    """Whether the tool was led along a surface for more than a moment."""
    return has_regions(log) and _longest_contact(log)[0].size > 1


def _longest_contact(log: RunLog) -> tuple[FloatArray, int]:
    """Return the samples of the longest way along a single region, and which it is."""
    held = log["region_labels"].values
    alone = held * (held.sum(axis=1, keepdims=True) == 1)
    longest: tuple[FloatArray, int] = np.zeros(0, dtype=int), 0
    for region, column in enumerate(alone.T):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], column, [0]]))).reshape(-1, 2)
        for begin, end in edges:
            if end - begin > longest[0].size:
                longest = np.arange(begin, end), region
    return longest


def _along(y_t: FloatArray, n: FloatArray) -> FloatArray:
    """Return the way of a tool along a surface [m], shape (samples, 2).

    The second coordinate rises as much as the surface allows, the first is level.
    """
    up = np.eye(3)[np.argmin(np.abs(n).mean(axis=0)) if np.abs(n[:, 2]).mean() > 0.9 else 2]
    rising = up - n * (n @ up)[:, None]
    rising /= np.linalg.norm(rising, axis=1, keepdims=True)
    level = np.cross(rising, n)
    steps = np.diff(y_t, axis=0)
    ways = np.stack([np.sum(steps * e[:-1], axis=1) for e in (level, rising)], axis=1)
    return np.vstack([np.zeros(2), np.cumsum(ways, axis=0)])


def gives_energy(log: RunLog) -> bool:
    """Whether regions moved or gave way, so that energy went back and forth."""
    if "guide" in log:
        return True
    if not has_regions(log):
        return False
    slots = log["near_regions"].values
    return bool(np.any(log["spring_energy"].values > 0.0)) or _moves(slots)


def _moves(slots: FloatArray) -> bool:
    u = slots.reshape(len(slots), -1, len(SLOT))[..., SLOT.index("u")]
    return bool(np.any(u != 0.0))


def draw_energy(log: RunLog) -> Drawing:
    """Tank, springs, what the hand has given, and the pace of moving regions."""
    canvas, (stored, given, pace) = make_panels(3)
    stored.plot(log.time, log["tank"].values[:, 0], color=COLOURS[0], label="tank $x$")
    stored.plot(
        log.time,
        log["spring_energy"].values[:, 0],
        color=COLOURS[1],
        label="springs and guides $V$" if "guide" in log else "springs $V$",
    )
    stored.set(title="Energy that is stored", ylabel="energy in J")
    period = float(np.median(np.diff(log.time)))
    power = np.sum(log["guiding_force"].values * log["velocity_command"].values, axis=1)
    given.plot(log.time, np.cumsum(power) * period, color=COLOURS[2], label="the hand's work")
    bound = -float(log["tank"].values[0, 0] + log["spring_energy"].values[0, 0])
    given.axhline(bound, color=INK, linestyle="--", label="never below")
    given.set(title=r"Work of the hand $\int f \cdot v\, dt$", ylabel="work in J")
    pace.plot(log.time, log["region_rate"].values[:, 0], color=COLOURS[3])
    pace.set(
        title=r"Share of their pace with which regions move $\rho$", ylabel="share", ylim=(0, 1.05)
    )
    for panel in (stored, given):
        place_legend(panel)
    caption = (
        "The tank pays for what moving or pushing regions give to the hand, and damping fills it; "
        "the work of the hand never falls below what was stored at the start."
    )
    return Drawing("energy", "Energy of the fixtures", caption, canvas)


def held_by_robot(log: RunLog) -> bool:
    """Whether what the robot itself can do held the tool."""
    return bool(np.any(log["limit_force"].values > 0.0))


def draw_limits(log: RunLog) -> Drawing:
    """Which joint, at its speed or its end, or which singular posture held the tool, and how."""
    canvas, (force, speed) = make_panels(2)
    forces = log["limit_force"]
    shown = np.flatnonzero(np.any(forces.values > 0.0, axis=0))
    for k, column in enumerate(shown):
        colour = COLOURS[k % len(COLOURS)]
        label = _limit_label(forces.labels[column])
        force.plot(log.time, forces.values[:, column], color=colour, label=label)
    force.set(title="Forces by which the robot's own limits hold the hand", ylabel="force in N")
    velocity = np.gradient(log["y_t"].values, log.time, axis=0)
    speed.plot(log.time, np.linalg.norm(velocity, axis=1), color=COLOURS[0])
    speed.set(title="Speed of the tool", ylabel="speed in m/s")
    place_legend(force)
    caption = (
        "Where joints are at their speeds or ends, or the arm is nearly singular, the hand feels a "
        "wall as that of a region."
    )
    return Drawing("limits", "Limits of the robot", caption, canvas)


def _limit_label(kind: str) -> str:
    """Return ``speed_3`` as ``axis 3, speed``."""
    name, _, axis = kind.partition("_")
    return f"axis {axis}, {name}" if axis else "singular posture"
