"""Joints: positions and velocities of links and motors, and deflection between them.

Revolute joints are in rad, prismatic ones (slides) in m; texts follow the units of the signals.
"""

from typing import TYPE_CHECKING

import numpy as np

from diagrams.station import Station
from experiments.results.feature import Feature, Raw
from experiments.results.run_log import FloatArray, RunLog, Signal
from reporting import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

MILLI = 1e3
MOVERS = {"rad/s": "joint", "m/s": "slide"}
_MILLI_UNITS = {"rad": "mrad", "m": "mm"}
POSITION_UNITS = {"rad": (180.0 / np.pi, "deg")}
_REACH = 0.1  # of the range of an axis, below which its distance from a limit matters
_NEAR = 0.5  # of the span that a joint's panel shows, within which a limit is shown, too
_BORDER = 0.15  # of that span, around the shown values
_FORBIDDEN, _BEYOND = "#E5E7EB", "#FECACA"


def add_joints(log: RunLog, station: Station, raw: Raw) -> None:
    """Add actual and measured positions and velocities of links and of motors of elastic joints.

    Args:
        log: Log of the run, which is extended.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    limits = {
        "q_J": station.robot.gather("position_limits"),
        "v_J": station.robot.gather("velocity_limit"),
    }
    names = ["q_J", "v_J"]
    if station.robot.elastic_joints.any():  # motors of rigid joints move as the links do
        names += ["q_M", "v_M"]
    for suffix in ("", "_measured"):
        if f"joint_state{suffix}" in raw:
            state = np.hsplit(raw[f"joint_state{suffix}"], 4)
            for name, values in zip(names, state, strict=False):
                log.add(f"{name}{suffix}", values, limits=limits.get(f"{name}{suffix}"))


def has_spare_joints(log: RunLog) -> bool:
    """Return whether a run's robot has more joints than task coordinates."""
    outputs = sum(log[name].dim for name in ("eta", "xi", "phi") if name in log)
    return 0 < outputs < log["q_J"].dim


def draw_velocities(log: RunLog) -> style.Drawing:
    """Draw velocities of joints or slides and of motors, and their difference."""
    signals = {name: log[name] for name in ("v_J", "v_M") if name in log}
    mover = MOVERS.get(signals["v_J"].unit, "joint and slide")
    titles = {
        "v_J": f"{mover.capitalize()} velocities " + r"$\dot q_J$",
        "v_M": r"Motor velocities $\dot q_M$",
    }
    both = len(signals) == 2
    canvas, panels = style.make_panels(len(signals) + both)
    for panel, (name, signal) in zip(panels, signals.items(), strict=False):
        style.draw_components(panel, log.time, signal.values, axis_labels(signal.dim))
        for axis in range(signal.dim):
            draw_limit(panel, signal, axis)
        panel.set(ylabel=f"velocity in {signal.unit}", title=titles[name])
    style.add_legend(panels[0])
    limited = any(nears_limit(signals["v_J"], axis) for axis in range(signals["v_J"].dim))
    limits = "; dashed lines are limits within reach" if limited else ""
    if not both:
        title = f"{mover.capitalize()} velocities"
        return style.Drawing(
            "velocities", title, f"Velocities of the {plural(mover)}{limits}.", canvas
        )
    difference = log["v_M"].values - log["v_J"].values
    style.draw_components(panels[2], log.time, difference, axis_labels(difference.shape[1]))
    title = r"Difference $\dot q_M - \dot q_J$"
    panels[2].set(ylabel=f"velocity in {log['v_M'].unit}", title=title)
    caption = "They differ by the deflection rate of the elastic transmissions"
    title = f"{mover.capitalize()} and motor velocities"
    return style.Drawing("velocities", title, f"{caption}{limits}.", canvas)


def draw_deflection(log: RunLog) -> style.Drawing:
    """Draw deflection of the elastic joints."""
    canvas, (panel,) = style.make_panels(1, height=3.2)
    deflection = MILLI * (log["q_M"].values - log["q_J"].values)
    panel.axhline(0.0, color=style.REFERENCE, linewidth=0.8)
    style.draw_components(panel, log.time, deflection, axis_labels(deflection.shape[1]))
    unit = _MILLI_UNITS.get(log["q_M"].unit, "mrad or mm")
    panel.set(ylabel=f"deflection in {unit}", title=r"Deflection $q_M - q_J$")
    style.add_legend(panel)
    caption = "Deflection of the elastic transmissions, motor minus joint coordinate."
    return style.Drawing("deflection", "Joint deflection", caption, canvas)


def axis_labels(count: int) -> list[str]:
    """Return labels ``axis 1`` and so on."""
    return [f"axis {i + 1}" for i in range(count)]


def plural(words: str) -> str:
    """Return the plural, e.g. ``joints and slides`` of ``joint and slide``."""
    return " and ".join(f"{word}s" for word in words.split(" and "))


def draw_limit(panel: "Axes", signal: Signal, axis: int) -> None:
    """Draw the limit of an axis and its negative, if near enough to matter."""
    if signal.limits is None or not nears_limit(signal, axis):
        return
    limit = float(signal.limits[axis])
    at_limit = style.largest(signal.values[:, axis]) >= limit * (1.0 - 1e-9)
    colour = style.ALERT if at_limit else f"C{axis}"
    for level in (-limit, limit):
        panel.axhline(level, linestyle="--", color=colour, linewidth=1.0)


def nears_limit(signal: Signal, axis: int) -> bool:
    """Return whether an axis comes within a factor of two of its limit."""
    if signal.limits is None or not np.isfinite(signal.limits[axis]):
        return False
    return style.largest(signal.values[:, axis]) >= 0.5 * float(signal.limits[axis])


def draw_positions(log: RunLog) -> style.Drawing:
    """Draw positions of joints or slides, in separate panels where limits or postures matter.

    These are used for redundant robots, with a reference posture, or near joint limits.

    Args:
        log: With ``q_J``, perhaps with ``q_posture``.
    """
    signal = log["q_J"]
    mover = MOVERS.get(f"{signal.unit}/s", "joint and slide")
    title = f"{mover.capitalize()} positions"
    near = _limits_within_reach(signal)
    if near or "q_posture" in log or has_spare_joints(log):
        canvas, caption = _one_each(log, near)
    else:
        canvas, (panel,) = style.make_panels(1, height=3.2)
        factor, unit = position_unit(signal)
        style.draw_components(panel, log.time, factor * signal.values, axis_labels(signal.dim))
        panel.set(ylabel=f"position in {unit}", title=f"{title} $q_J$")
        style.add_legend(panel)
        caption = ""
    return style.Drawing("positions", title, f"Positions of the {plural(mover)}{caption}.", canvas)


def position_unit(signal: Signal) -> tuple[float, str]:
    """Return the factor to the displayed unit of positions, and its name."""
    return POSITION_UNITS.get(signal.unit, (1.0, signal.unit))


def _one_each(log: RunLog, near: dict[tuple[int, int], bool]) -> "tuple[Canvas, str]":
    """Draw a panel for each joint, and return the canvas and its part of the caption."""
    signal = log["q_J"]
    factor, unit = position_unit(signal)
    posture = log["q_posture"].values if "q_posture" in log else None
    canvas, panels = style.make_panels(signal.dim, height=1.15)
    has_limits = False
    for axis, panel in enumerate(panels):
        q = factor * signal.values[:, axis]
        panel.plot(log.time, q, color=f"C{axis}", label="position")
        shown = [q]
        if posture is not None:
            reference = factor * posture[:, axis]
            panel.plot(log.time, reference, "--", color=style.INK, linewidth=1.1, label="posture")
            shown.append(reference)
        sides = {side: beyond for (joint, side), beyond in near.items() if joint == axis}
        has_limits |= _draw_limits(panel, log, axis, np.concatenate(shown), sides)
        panel.set(ylabel=unit)
        panel.set_title(f"axis {axis + 1}", fontsize=10)
    if posture is not None:
        style.add_legend(panels[0])
    caption = " each in its own panel"
    caption += "; grey beyond its limits" if has_limits else "; limits are out of view"
    caption += ", red where they are exceeded" if any(near.values()) else ""
    caption += "; dashed: the reference posture" if posture is not None else ""
    return canvas, f",{caption}"


def _draw_limits(
    panel: "Axes", log: RunLog, axis: int, shown: FloatArray, near: dict[int, bool]
) -> bool:
    """Scale a panel and shade the range beyond visible limits; return whether one is visible.

    Args:
        panel: Panel of one joint.
        log: The log.
        axis: The joint.
        shown: Values in the panel, in its unit.
        near: The sides, 0 below and 1 above, with a limit within reach, and whether it is exceeded.
    """
    signal = log["q_J"]
    factor, _ = position_unit(signal)
    finite = shown[np.isfinite(shown)]
    if not finite.size:
        return False
    low, high = float(finite.min()), float(finite.max())
    span = max(high - low, factor * 0.02)
    limits = (-np.inf, np.inf) if signal.limits is None else tuple(factor * signal.limits[axis])
    for side, limit in enumerate(limits):
        distance = (low - limit) if side == 0 else (limit - high)
        if np.isfinite(limit) and (side in near or distance < _NEAR * span):
            low, high = min(low, limit), max(high, limit)
    border = _BORDER * max(high - low, span)
    low, high = low - border, high + border
    panel.set_ylim(low, high)
    in_sight = False
    for side, limit in enumerate(limits):
        if not low < limit < high:
            continue
        in_sight = True
        outer = low if side == 0 else high
        panel.axhspan(limit, outer, color=_FORBIDDEN, linewidth=0.0, zorder=0.4)
        colour = style.ALERT if near.get(side) else "#9CA3AF"
        panel.axhline(limit, linestyle="--", color=colour, linewidth=1.0)
    if any(near.values()):
        q = factor * signal.values[:, axis]
        style.shade([panel], log.time, (q < limits[0]) | (q > limits[1]), "beyond a limit", _BEYOND)
    return in_sight


def _limits_within_reach(signal: Signal) -> dict[tuple[int, int], bool]:
    """Return axis and side (0 below, 1 above) of nearby limits, and whether each is exceeded."""
    if signal.limits is None:
        return {}
    near = {}
    for axis, ends in enumerate(signal.limits):
        q = signal.values[np.isfinite(signal.values[:, axis]), axis]
        reach = _REACH * (ends[1] - ends[0]) if np.isfinite(ends).all() else 0.0
        for side, sign in enumerate((-1.0, 1.0)):
            beyond = float(np.max(sign * (q - ends[side]), initial=-np.inf))
            if beyond > -reach:
                near[axis, side] = beyond > 0.0
    return near


FEATURE = Feature(
    signals=add_joints,
    figures={
        "positions": draw_positions,
        "velocities": draw_velocities,
        "deflection": draw_deflection,
    },
)
