"""Hand guiding of the tool within virtual fixtures."""

from typing import TYPE_CHECKING

import numpy as np

from diagrams.scenario import Scenario, Target
from diagrams.station import Station
from experiments.results.feature import Feature, Raw
from experiments.results.forces_feature import shade_pushes
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.fixtures.contact_program import SLOTS
from pfsc_drake.control.fixtures.record import SLOT, GuidanceRecord, Mode
from pfsc_drake.controller.tasks.space_task import SpaceTask
from reporting import style
from reporting.metrics import Metrics

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# names in the log of the record's fields
_SINGLE = {
    "velocity": "velocity_command",
    "point": "rest_point",
    "force": "guiding_force",
    "clock": "region_clock",
    "rate": "region_rate",
    "spring": "spring_energy",
    "damping": "free_damping",
    "limit": "speed_limit",
    "squeezed": "squeezed",
}
MILLI = 1e3
FAR = 0.03  # m, distances above which are not shown
CLOSE = 3e-4  # m, of the enlargement
MOST_NAMED = 6  # regions with an entry in a legend


def add_guidance(log: RunLog, station: Station, raw: Raw) -> None:
    """Add modes, data of the guidance rules, and the actual distance from each region.

    Args:
        log: Log of the run, which is extended.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    task = station.task
    if "guidance" not in raw or not isinstance(task, SpaceTask):
        return
    record = GuidanceRecord(len(task.fixtures))
    rows = {name: raw["guidance"][:, part] for name, part in record.fields.items()}
    modes = np.nan_to_num(rows["mode"]).astype(int)
    log.add("mode", modes, labels=[mode.name.lower() for mode in Mode])
    log.add("tank", rows["tank"], labels=["x"])
    for name, signal in _SINGLE.items():
        log.add(signal, rows[name])
    names = [fixture.name for fixture in task.fixtures]
    slots = [f"{key}_{slot}" for slot in range(SLOTS) for key in SLOT]
    log.add("near_regions", rows["near"], labels=slots)
    for name in ("labels", "evaluated", "on"):
        log.add(f"region_{name}", np.nan_to_num(rows[name]).astype(int), labels=names)
    distances = task.distances(
        raw["true_pose"][:, :3], region_times(log, task.command_dynamics.lag)
    )
    distances[rows["on"] == 0.0] = np.nan  # a region that is switched off is nowhere
    log.add("region_distance", distances, labels=names)


def region_times(log: RunLog, lag: float) -> FloatArray:
    """Return the clock of moving regions at the tool's current position, shape (samples,).

    The rules evaluate the tool's future rest point, and the regions at that time.

    Args:
        log: With ``region_clock``.
        lag: Delay until the tool reaches the rest point [s].
    """
    clock = log["region_clock"].values[:, 0]
    if clock.size == 0:
        return clock
    return np.interp(log.time - lag, log.time, clock, left=clock[0] - lag)


def slots_of(log: RunLog, region: int) -> dict[str, FloatArray]:
    """Return the logged data of a region while it was near, NaN otherwise, each (samples, ..).

    Args:
        log: With ``near_regions``.
        region: Its index.

    Returns:
        Values by the names of ``SLOT``, the normal as ``n``, shape (samples, 3).
    """
    slots = log["near_regions"].values.reshape(len(log.time), -1, len(SLOT))
    values = np.full((len(log.time), len(SLOT)), np.nan)
    rows, where = np.nonzero(slots[..., 0] == region)
    values[rows] = slots[rows, where]
    columns = dict(zip(SLOT, values.T, strict=True))
    begin = SLOT.index("n_x")
    return columns | {"n": values[:, begin : begin + 3]}


def guidance_metrics(log: RunLog) -> Metrics:
    """Return the metrics of guidance: violations of regions, forces, energy, evaluations.

    Args:
        log: Log of a run; without ``region_distance`` there are no such metrics.
    """
    metrics = Metrics()
    if "region_distance" not in log or not log.time.size:
        return metrics
    if "phi" in log:  # the reference orientation of a tool turned by hand is not zero
        error = np.linalg.norm(log["phi"].values - log["phi_p"].values, axis=1)
        metrics.add("max_orientation_error", float(np.nanmax(error)))
    distance, soft = log["region_distance"].values, soft_regions(log)
    hard = np.setdiff1d(np.arange(distance.shape[1]), soft)
    if hard.size:
        metrics.add("deepest_violation", deepest_violation(distance[:, hard]))
    if soft.size:
        metrics.add(
            "deepest_in_soft", max(0.0, float(-np.nanmin(distance[:, soft], initial=np.inf)))
        )
    command = log["velocity_command"].values
    steps = np.linalg.norm(np.diff(command, axis=0), axis=1)
    metrics.add("largest_command_step", float(np.nanmax(steps, initial=0.0)))
    metrics.add("largest_command", float(np.nanmax(np.linalg.norm(command, axis=1))))
    period = log.period
    power = np.sum(log["guiding_force"].values * command, axis=1)
    # energy that the operator extracted from the fixtures up to any instant
    metrics.add("energy_from_fixtures", max(0.0, float(-np.nanmin(np.cumsum(power)) * period)))
    metrics.add("least_tank", float(np.nanmin(log["tank"].values)))
    modes = log["mode"].values[:, 0]
    changes = np.count_nonzero(np.diff(modes))
    metrics.add("mode_changes_per_second", changes / max(log.time[-1], period))
    for number, name in enumerate(log["mode"].labels):
        metrics.add(f"time_{name}", float(np.count_nonzero(modes == number) * period))
    evaluated = log["region_evaluated"].values.sum(axis=1)
    metrics.add("distances_per_tick", float(evaluated.mean()))
    metrics.add("distances_per_tick_max", float(evaluated.max()))
    return metrics


def deepest_violation(distance: FloatArray) -> float:
    """Return the largest penetration of regions [m], 0 without any.

    An initial penetration, also when a region is switched on, is no violation as long as it
    decreases.

    Args:
        distance: Distance from each region, NaN while it is switched off, shape (samples, M) [m].
    """
    deepest = 0.0
    for depth in np.maximum(-distance, 0.0).T:
        gone = np.isnan(depth)
        begins = np.flatnonzero(np.diff(gone, prepend=True) & ~gone)
        for part in np.split(depth, begins)[1:]:
            part = part[~np.isnan(part)]
            deepest = max(deepest, float(np.max(part - np.minimum.accumulate(part))))
    return deepest


def soft_regions(log: RunLog) -> FloatArray:
    """Return the indices of regions that were near and soft.

    Args:
        log: With ``near_regions``.
    """
    slots = log["near_regions"].values.reshape(len(log.time), -1, len(SLOT))
    index, stiffness = slots[..., SLOT.index("index")], slots[..., SLOT.index("stiffness")]
    return np.unique(index[(stiffness > 0.0) & (index >= 0.0)]).astype(int)


def has_regions(log: RunLog) -> bool:
    """Return whether the log has forbidden regions."""
    return log["region_distance"].dim > 0


def draw_guidance(log: RunLog) -> style.Drawing | None:
    """Draw mode, distance from near regions, also enlarged, and commanded speed."""
    if not has_regions(log):
        return None
    canvas, (mode, distance, close, speed) = style.make_panels(4)
    _draw_mode(mode, log)
    values, names = _near_distances(log)
    for panel in (distance, close):
        panel.axhline(0.0, color=style.REFERENCE, linewidth=0.8)
        for k, (column, name) in enumerate(zip(values.T, names, strict=True)):
            label = name if k < MOST_NAMED else None
            panel.plot(log.time, MILLI * column, color=f"C{k}", label=label)
        panel.set(ylabel="distance in mm")
    distance.set(title="Distance from the regions", ylim=(-0.05 * MILLI * FAR, MILLI * FAR))
    close.set(title="Distance from the regions, enlarged", ylim=(-MILLI * CLOSE, MILLI * CLOSE))
    command = log.norm("velocity_command")
    speed.plot(log.time, command, color="C0")
    speed.set(title="Commanded speed of the tool", ylabel="speed in m/s")
    shade_pushes([distance], log)
    style.add_legend(distance)
    caption = (
        "Mode of guidance, actual distance from the regions, negative inside, and commanded speed."
    )
    return style.Drawing("guidance", "Guidance within fixtures", caption, canvas)


def _draw_mode(panel: "Axes", log: RunLog) -> None:
    names = log["mode"].labels
    panel.step(log.time, log["mode"].values[:, 0], where="post", color="C0")
    panel.set(title="Mode", yticks=range(len(names)), ylim=(-0.3, len(names) - 0.7))
    panel.set_yticklabels(names)


def _near_distances(log: RunLog) -> tuple[FloatArray, list[str]]:
    """Return the distances of near regions [m], the closest first, and their names."""
    values, names = log["region_distance"].values, log["region_distance"].labels
    least = np.nanmin(values, axis=0, initial=np.inf)
    shown = [i for i in np.argsort(least) if least[i] < FAR]
    return values[:, shown], [names[i] for i in shown]


def draw_contact(log: RunLog) -> style.Drawing | None:
    """Draw the longest contact with one surface: coordinates and forces."""
    rows, region = _longest_contact(log)
    if rows.size <= 1:
        return None
    canvas, (tangential, transversal, force) = style.make_panels(3)
    time = log.time[rows]
    slot = slots_of(log, region)
    n, phi = slot["n"][rows], slot["phi"][rows]
    coordinates = _along(log["y_t"].values[rows], n)
    style.draw_components(tangential, time, coordinates, [r"$\eta_{1,1}$", r"$\eta_{1,2}$"])
    tangential.set(title="Tangential coordinates", ylabel="distance in m")
    xi = log["region_distance"].values[rows, region]
    transversal.axhline(0.0, color=style.REFERENCE, linewidth=0.8)
    transversal.plot(time, MILLI * xi, color="C0", label=r"$\xi_1$")
    transversal.set(title="Transversal coordinate, negative inside", ylabel="distance in mm")
    f = log["guiding_force"].values[rows]
    pressing = -np.sum(f * n, axis=1)
    force.plot(time, phi, color="C1", label=r"fixture $\varphi$")
    force.plot(time, pressing, "--", color=style.INK, label="operator, normal")
    force.plot(
        time,
        np.linalg.norm(f + pressing[:, None] * n, axis=1),
        color="C2",
        label="operator, tangential",
    )
    force.set(title="Forces", ylabel="force in N")
    for panel in (tangential, transversal, force):
        style.add_legend(panel)
    name = log["region_distance"].labels[region]
    caption = f"Longest contact with one surface, {name}."
    return style.Drawing("contact", "Contact with a surface", caption, canvas)


def _longest_contact(log: RunLog) -> tuple[FloatArray, int]:
    """Return the samples of the longest contact with a single region, and its index."""
    contacts = log["region_labels"].values
    alone = contacts * (contacts.sum(axis=1, keepdims=True) == 1)
    longest: tuple[FloatArray, int] = np.zeros(0, dtype=int), 0
    for region, column in enumerate(alone.T):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], column, [0]]))).reshape(-1, 2)
        for begin, end in edges:
            if end - begin > longest[0].size:
                longest = np.arange(begin, end), region
    return longest


def _along(y_t: FloatArray, n: FloatArray) -> FloatArray:
    """Return tangential coordinates of a tool along a surface [m], shape (samples, 2).

    The second coordinate points along the steepest ascent, the first is horizontal.
    """
    up = np.eye(3)[np.argmin(np.abs(n).mean(axis=0)) if np.abs(n[:, 2]).mean() > 0.9 else 2]
    rising = up - n * (n @ up)[:, None]
    rising /= np.linalg.norm(rising, axis=1, keepdims=True)
    level = np.cross(rising, n)
    steps = np.diff(y_t, axis=0)
    parts = np.stack([np.sum(steps * e[:-1], axis=1) for e in (level, rising)], axis=1)
    return np.vstack([np.zeros(2), np.cumsum(parts, axis=0)])


def gives_energy(log: RunLog) -> bool:
    """Return whether regions or guides exchanged energy with the operator."""
    if "guide" in log:
        return True
    if not has_regions(log):
        return False
    slots = log["near_regions"].values
    return bool(np.any(log["spring_energy"].values > 0.0)) or _moves(slots)


def _moves(slots: FloatArray) -> bool:
    u = slots.reshape(len(slots), -1, len(SLOT))[..., SLOT.index("u")]
    return bool(np.any(u != 0.0))


def draw_energy(log: RunLog) -> style.Drawing | None:
    """Draw energy of tank and springs, work of the operator, and time scaling of regions."""
    if not gives_energy(log):
        return None
    canvas, (stored, supplied, scaling) = style.make_panels(3)
    stored.plot(log.time, log["tank"].values[:, 0], color="C0", label="tank $x$")
    stored.plot(
        log.time,
        log["spring_energy"].values[:, 0],
        color="C1",
        label="springs and guides $V$" if "guide" in log else "springs $V$",
    )
    stored.set(title="Stored energy", ylabel="energy in J")
    period = log.period
    power = np.sum(log["guiding_force"].values * log["velocity_command"].values, axis=1)
    supplied.plot(log.time, np.cumsum(power) * period, color="C2", label="operator's work")
    bound = -float(log["tank"].values[0, 0] + log["spring_energy"].values[0, 0])
    supplied.axhline(bound, color=style.INK, linestyle="--", label="lower bound")
    supplied.set(title=r"Work of the operator $\int f \cdot v\, dt$", ylabel="work in J")
    scaling.plot(log.time, log["region_rate"].values[:, 0], color="C3")
    scaling.set(title=r"Time scaling of moving regions $\rho$", ylabel="share", ylim=(0, 1.05))
    for panel in (stored, supplied):
        style.add_legend(panel)
    caption = (
        "The tank supplies the energy of moving or pushing regions, and damping fills it; the work "
        "of the operator is bounded below by minus the energy stored at the start."
    )
    return style.Drawing("energy", "Energy of the fixtures", caption, canvas)


def _requirements(settings: Scenario) -> dict[str, Target]:
    """Require that no hard region is entered by more than its bound."""
    if settings.fixtures is None:
        return {}
    return {"deepest_violation": Target(f"<= {settings.fixtures.bound:g}", "fixtures.bound")}


FEATURE = Feature(
    signals=add_guidance,
    metrics=lambda log, station, settings: guidance_metrics(log),
    requirements=_requirements,
    always=("deepest_violation",),
    figures={"guidance": draw_guidance, "contact": draw_contact, "energy": draw_energy},
)
