"""List of the features of runs, and their figures."""

from collections.abc import Iterator, Sequence

from experiments.results import (
    arrival_feature,
    coordinates_feature,
    drives_feature,
    fastest_feature,
    forces_feature,
    found_links_feature,
    friction_feature,
    guidance_audit,
    guidance_feature,
    guides_feature,
    hand_limits_feature,
    holder_feature,
    joint_limits_feature,
    joints_feature,
    link_feature,
    mounting_feature,
    obstacles_feature,
    orientation_feature,
    posture_feature,
    pressing_feature,
    pushes_feature,
    rest_feature,
    shape_feature,
    streaming_feature,
    teleoperation_feature,
)
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.geometry.surfaces.penalized_surface import Residuals
from reporting import style
from reporting.registry import FIGURES

# in the order of their metrics
_MODULES = [
    coordinates_feature,
    orientation_feature,
    drives_feature,
    forces_feature,
    arrival_feature,
    pressing_feature,
    guidance_feature,
    guides_feature,
    hand_limits_feature,
    guidance_audit,
    teleoperation_feature,
    mounting_feature,
    holder_feature,
    streaming_feature,
    obstacles_feature,
    friction_feature,
    shape_feature,
    joints_feature,
    joint_limits_feature,
    rest_feature,
    found_links_feature,
    link_feature,
    fastest_feature,
    posture_feature,
    pushes_feature,
]
FEATURES = [module.FEATURE for module in _MODULES]


def render_figures(
    log: RunLog, outline: Sequence[FloatArray], fit: Residuals | None = None
) -> list[style.Figure]:
    """Return all figures whose signals a log has, in the order of the report.

    Args:
        log: Log of a run.
        outline: Lines that show the path or surface, each [k, 3] m, in the frame of ``y_t``.
        fit: Residuals of the points that a surface was fitted to, if it was.
    """
    with style.project_style():
        return [style.render(drawing) for drawing in draw_figures(log, outline, fit)]


def draw_figures(
    log: RunLog, outline: Sequence[FloatArray], fit: Residuals | None = None
) -> Iterator[style.Drawing]:
    """Draw all figures whose signals a log has, one after the other.

    Args:
        log: Log of a run.
        outline: Lines that show the path or surface, each [k, 3] m, in the frame of ``y_t``.
        fit: Residuals of the points that a surface was fitted to, if it was.
    """
    if log.time.size == 0:
        return
    draws = {name: draw for feature in FEATURES for name, draw in feature.figures.items()}
    draws["path"] = lambda log: shape_feature.draw_path(log, outline)
    known = set(log.signals)
    if fit is not None:
        draws["surface_fit"] = lambda log: shape_feature.draw_surface_fit(fit)
        known.add("fitted_surface")
    for name, figure in FIGURES.items():
        if set(figure.needs) <= known and (drawing := draws[name](log)) is not None:
            yield drawing
