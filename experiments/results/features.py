"""The features of runs: a list, and the figures that they draw."""

from collections.abc import Iterator, Sequence

from experiments.results import (
    arrival,
    coordinates,
    drives,
    fastest,
    forces,
    found_links,
    friction,
    guidance,
    guidance_audit,
    guides,
    hand_limits,
    holder,
    joint_limits,
    joints,
    link,
    mounting,
    obstacles,
    orientation,
    posture,
    pressing,
    pushes,
    rest,
    shape,
    streaming,
    teleoperation,
)
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.geometry.surfaces.penalized_surface import Residuals
from reporting import style
from reporting.registry import FIGURES

# in the order of their metrics
FEATURES = [
    *(coordinates.FEATURE, orientation.FEATURE, drives.FEATURE, forces.FEATURE, arrival.FEATURE),
    *(pressing.FEATURE, guidance.FEATURE, guides.FEATURE, hand_limits.FEATURE),
    *(guidance_audit.FEATURE, teleoperation.FEATURE, mounting.FEATURE, holder.FEATURE),
    *(
        streaming.FEATURE,
        obstacles.FEATURE,
        friction.FEATURE,
        shape.FEATURE,
        joints.FEATURE,
        joint_limits.FEATURE,
    ),
    *(rest.FEATURE, found_links.FEATURE, link.FEATURE, fastest.FEATURE, posture.FEATURE),
    pushes.FEATURE,
]


def render_figures(
    log: RunLog, outline: Sequence[FloatArray], fit: Residuals | None = None
) -> list[style.Figure]:
    """Return all figures that a log has signals for, in the order of the report.

    Args:
        log: Log of a run.
        outline: Lines that show what is followed, each [k, 3] m, in the frame of ``y_t``.
        fit: Residuals of the points that a surface was fitted to, if it was.
    """
    with style.styled():
        return [style.render(drawing) for drawing in draw_figures(log, outline, fit)]


def draw_figures(
    log: RunLog, outline: Sequence[FloatArray], fit: Residuals | None = None
) -> Iterator[style.Drawing]:
    """Draw all figures that a log has signals for, one after the other.

    Args:
        log: Log of a run.
        outline: Lines that show what is followed, each [k, 3] m, in the frame of ``y_t``.
        fit: Residuals of the points that a surface was fitted to, if it was.
    """
    if log.time.size == 0:
        return
    draws = {name: draw for feature in FEATURES for name, draw in feature.figures.items()}
    draws["path"] = lambda log: shape.draw_path(log, outline)
    known = set(log.signals)
    if fit is not None:
        draws["surface_fit"] = lambda log: shape.draw_surface_fit(fit)
        known.add("fitted_surface")
    for name, figure in FIGURES.items():
        if set(figure.needs) <= known and (drawing := draws[name](log)) is not None:
            yield drawing
