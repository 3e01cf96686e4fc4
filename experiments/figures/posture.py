"""What an arm does beside its tool: positions and limits, posture, conditioning, pushes."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from experiments.figures.drives import MOVERS, axis_labels, plural
from experiments.figures.forces import shade_pushes
from experiments.results.posture import elbow_shift, has_spare_joints
from experiments.results.run_log import FloatArray, RunLog, Signal
from reporting.style import (
    ALERT,
    COLOURS,
    INK,
    REFERENCE,
    Drawing,
    draw_components,
    largest,
    make_panels,
    place_legend,
    shade,
)

POSITION_UNITS = {"rad": (180.0 / np.pi, "deg")}
_REACH = 0.1  # of the range of an axis, below which its distance from a limit matters
_NEAR = 0.5  # of the span that a joint's panel shows, within which a limit is shown, too
_ROOM = 0.15  # of that span, beyond what has to be seen
_FORBIDDEN, _BEYOND = "#E5E7EB", "#FECACA"
MILLI = 1e3
_WORTH_A_LOOK = 10.0  # times the threshold, below which conditioning is drawn of any arm


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
        panel: Panel of one joint.
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


def has_conditioning(log: RunLog) -> bool:
    """Whether conditioning is worth a look: of redundant arms, and near the threshold."""
    values = log["rcond"].values[np.isfinite(log["rcond"].values)]
    limits = log["rcond"].limits
    close = limits is not None and np.any(values < _WORTH_A_LOOK * limits[0, 0])
    return bool(values.size) and (has_spare_joints(log) or bool(close))


def draw_conditioning(log: RunLog) -> Drawing:
    """Reciprocal condition number of the decoupling matrix over time and along the path.

    Args:
        log: With ``rcond``, perhaps with ``eta``.
    """
    signal = log["rcond"]
    along = "eta" in log
    canvas, panels = make_panels(1 + along, height=2.6, common_time=False)
    values = np.where(signal.values[:, 0] > 0.0, signal.values[:, 0], np.nan)
    over = [("over time", "time in s", log.time)]
    over += [("along the path", r"$\eta$ in m", log["eta"].values[:, 0])] if along else []
    for panel, (title, label, horizontal) in zip(panels, over, strict=True):
        panel.semilogy(horizontal, values, color=COLOURS[0], label="conditioning")
        if signal.limits is not None:
            least = float(signal.limits[0, 0])
            panel.axhline(least, linestyle="--", color=ALERT, linewidth=1.2, label="threshold")
        panel.set(xlabel=label, ylabel="1 / condition", title=f"Conditioning {title}")
    place_legend(panels[0])
    caption = "Reciprocal condition number of the decoupling matrix; 0 at a singular posture"
    caption += ", dashed: the least that the law accepts" if signal.limits is not None else ""
    return Drawing("conditioning", "Conditioning along the path", f"{caption}.", canvas)


def draw_posture(log: RunLog) -> Drawing:
    """How far the joints are from the reference posture, and the swivel angle where it is logged.

    Args:
        log: With ``q_J`` and ``q_posture``, perhaps with ``swivel`` and its reference.
    """
    signal = log["q_J"]
    factor, unit = position_unit(signal)
    swivel = "swivel" in log
    canvas, panels = make_panels(1 + swivel, height=2.8)
    error = factor * (signal.values - log["q_posture"].values)
    panels[0].axhline(0.0, color=REFERENCE, linewidth=0.8)
    draw_components(panels[0], log.time, error, axis_labels(signal.dim))
    panels[0].set(ylabel=f"error in {unit}", title="Distance from the reference posture")
    if swivel:
        angle = np.rad2deg(log["swivel"].values)
        panels[1].plot(log.time, angle[:, 0], color=COLOURS[0], label="swivel angle")
        if angle.shape[1] == 2:
            panels[1].plot(log.time, angle[:, 1], "--", color=INK, linewidth=1.1, label="reference")
        panels[1].set(ylabel="angle in deg", title="Swivel angle of the elbow")
    shade_pushes(panels, log)
    for panel in panels:
        place_legend(panel)
    caption = "Joint coordinates less those of the reference posture; the tool needs the difference"
    return Drawing("posture", "Posture", f"{caption}.", canvas)


def has_pushes(log: RunLog) -> bool:
    """Whether forces on links are not all zero."""
    return largest(log["push_force"].values) > 0.0


def draw_pushes(log: RunLog) -> Drawing:
    """Forces on links, and how far the first pushed point is from its undisturbed motion.

    Args:
        log: With ``push_force`` and ``elbow``, perhaps with ``elbow_undisturbed``.
    """
    signal = log["push_force"]
    count = signal.dim // 3
    canvas, panels = make_panels(count + 1, height=2.4)
    for k, panel in enumerate(panels[:count]):
        part, names = signal.values[:, 3 * k : 3 * k + 3], signal.labels[3 * k : 3 * k + 3]
        panel.axhline(0.0, color=REFERENCE, linewidth=0.8)
        draw_components(panel, log.time, part, [f"$f_{name[-1]}$" for name in names])
        panel.set(ylabel="force in N", title=f"Force on {names[0].rsplit(' ', 1)[0]}, world axes")
    shift = MILLI * elbow_shift(log)
    panels[-1].axhline(0.0, color=REFERENCE, linewidth=0.8)
    draw_components(panels[-1], log.time, shift, ["$x$", "$y$", "$z$"])
    distance = np.linalg.norm(shift, axis=1)
    panels[-1].plot(log.time, distance, "--", color=INK, linewidth=1.1, label="distance")
    compared, name = "elbow_undisturbed" in log, log["elbow"].labels[0].rsplit(" ", 1)[0]
    title = f"{name} against the lap before" if compared else f"Way of {name} since the first push"
    panels[-1].set(ylabel="way in mm", title=title)
    for panel in panels:
        place_legend(panel)
    what = "its motion in the lap before" if compared else "where it was when the push began"
    caption = f"Forces on links, and how far {name} is from {what}, at the point that is pushed."
    return Drawing("pushes", "Forces on links", caption, canvas)
