"""Positions of joints or slides over time, their limits, and the posture that they are to take."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from experiments.figures.drives import MOVERS, axis_labels, plural
from experiments.results.posture_metrics import has_spare_joints
from experiments.results.run_log import FloatArray, RunLog, Signal
from reporting.style import (
    ALERT,
    COLOURS,
    INK,
    Drawing,
    draw_components,
    make_panels,
    place_legend,
    shade,
)

POSITION_UNITS = {"rad": (180.0 / np.pi, "deg")}
_REACH = 0.1  # of the range of an axis, below which its distance from a limit matters
_NEAR = 0.5  # of the span that a joint's panel shows, within which a limit is shown, too
_ROOM = 0.15  # of that span, beyond what has to be seen
_FORBIDDEN, _BEYOND = "#E5E7EB", "#FECACA"


def draw_positions(log: RunLog) -> Drawing:
    """Positions of joints or slides; each in a panel of its own where limits or postures matter.

    That is with more joints than coordinates of the path, with a reference posture, or where a
    joint comes near its limits.

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
        canvas, (panel,) = make_panels(1, height=3.2)
        factor, unit = position_unit(signal)
        draw_components(panel, log.time, factor * signal.values, axis_labels(signal.dim))
        panel.set(ylabel=f"position in {unit}", title=f"{title} $q_J$")
        place_legend(panel)
        caption = ""
    return Drawing("positions", title, f"Positions of the {plural(mover)}{caption}.", canvas)


def position_unit(signal: Signal) -> tuple[float, str]:
    """Factor to the unit of an axis of positions, and its name."""
    return POSITION_UNITS.get(signal.unit, (1.0, signal.unit))


def _one_each(log: RunLog, near: dict[tuple[int, int], bool]) -> tuple[Canvas, str]:
    """A panel for each joint, and what it adds to the caption."""
    signal = log["q_J"]
    factor, unit = position_unit(signal)
    posture = log["q_posture"].values if "q_posture" in log else None
    canvas, panels = make_panels(signal.dim, height=1.15)
    seen = False
    for axis, panel in enumerate(panels):
        q = factor * signal.values[:, axis]
        panel.plot(log.time, q, color=COLOURS[axis % len(COLOURS)], label="position")
        shown = [q]
        if posture is not None:
            reference = factor * posture[:, axis]
            panel.plot(log.time, reference, "--", color=INK, linewidth=1.1, label="posture")
            shown.append(reference)
        sides = {side: beyond for (joint, side), beyond in near.items() if joint == axis}
        seen |= _draw_limits(panel, log, axis, np.concatenate(shown), sides)
        panel.set(ylabel=unit)
        panel.set_title(f"axis {axis + 1}", fontsize=10)
    if posture is not None:
        place_legend(panels[0])
    caption = " each in a panel of its own"
    caption += "; grey beyond its limits" if seen else "; limits are out of sight"
    caption += ", red where they are passed" if any(near.values()) else ""
    caption += "; dashed: the reference posture" if posture is not None else ""
    return canvas, f",{caption}"


def _draw_limits(
    panel: Axes, log: RunLog, axis: int, shown: FloatArray, near: dict[int, bool]
) -> bool:
    """Scales a panel and shades what is beyond the limits that are in sight; whether one is.

    Args:
        panel: Of one joint.
        log: The log.
        axis: The joint.
        shown: What the panel has to show, in its unit.
        near: The sides, 0 below and 1 above, on which a limit is within reach, and whether it is
            passed.
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
    room = _ROOM * max(high - low, span)
    low, high = low - room, high + room
    panel.set_ylim(low, high)
    in_sight = False
    for side, limit in enumerate(limits):
        if not low < limit < high:
            continue
        in_sight = True
        outer = low if side == 0 else high
        panel.axhspan(limit, outer, color=_FORBIDDEN, linewidth=0.0, zorder=0.4)
        colour = ALERT if near.get(side) else "#9CA3AF"
        panel.axhline(limit, linestyle="--", color=colour, linewidth=1.0)
    if any(near.values()):
        q = factor * signal.values[:, axis]
        shade([panel], log.time, (q < limits[0]) | (q > limits[1]), "beyond a limit", _BEYOND)
    return in_sight


def _limits_within_reach(signal: Signal) -> dict[tuple[int, int], bool]:
    """Axis and side, 0 below and 1 above, of limits that axes come near; whether it is passed."""
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
