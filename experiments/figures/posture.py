"""What an arm does beside its tool: posture, conditioning, pushes on its links."""

import numpy as np

from experiments.figures.drives import axis_labels
from experiments.figures.forces import shade_pushes
from experiments.figures.positions import position_unit
from experiments.results.posture_metrics import elbow_shift, has_spare_joints
from experiments.results.run_log import RunLog
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
)

MILLI = 1e3
_WORTH_A_LOOK = 10.0  # times the threshold, below which conditioning is drawn of any arm


def has_conditioning(log: RunLog) -> bool:
    """Whether conditioning is worth a look: of redundant arms, and near the threshold."""
    if "rcond" not in log or "q_J" not in log:
        return False
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
    """Whether the log has forces on links that are not all zero."""
    signals = ("push_force", "elbow")
    return all(name in log for name in signals) and largest(log["push_force"].values) > 0.0


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
