"""The figures of a path following run, chosen by the signals that its log has."""

from collections.abc import Callable, Iterator, Sequence

import matplotlib

from experiments.figures.coordinates import (
    draw_angles,
    draw_axis,
    draw_orientation,
    draw_progress,
    draw_transversal,
)
from experiments.figures.drives import (
    draw_deflection,
    draw_efforts,
    draw_friction,
    draw_pace,
    draw_velocities,
)
from experiments.figures.forces import (
    draw_damping,
    draw_force_map,
    draw_forces,
    draw_pressing,
    has_forces,
    has_varying_damping,
)
from experiments.figures.friction import draw_friction_coefficients, draw_friction_estimate
from experiments.figures.guidance import (
    draw_contact,
    draw_energy,
    draw_guidance,
    draw_limits,
    gives_energy,
    has_contact,
    has_regions,
    held_by_robot,
)
from experiments.figures.mounting import draw_mounting, draw_use_case
from experiments.figures.path import draw_notch_position, draw_path, draw_surface_fit
from experiments.figures.posture import (
    draw_conditioning,
    draw_positions,
    draw_posture,
    draw_pushes,
    has_conditioning,
    has_pushes,
)
from experiments.figures.virtual_input import draw_virtual_input, has_virtual_input
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.geometry.surfaces.residuals import Residuals
from reporting.style import STYLE, Drawing, Figure, render

_SPACE = 3  # tangential coordinates of a tool that is led freely


def render_figures(
    log: RunLog, outline: Sequence[FloatArray], fit: Residuals | None = None
) -> list[Figure]:
    """Returns all figures that the log has signals for, in the order of the report.

    Args:
        log: Of a path following run.
        outline: Lines that show what is followed, each [k, 3] m, in the frame of ``y_t``.
        fit: Where the points stand that a surface was fitted to, if it was.
    """
    with matplotlib.rc_context(STYLE):
        return [render(drawing) for drawing in draw_figures(log, outline, fit)]


def draw_figures(
    log: RunLog, outline: Sequence[FloatArray], fit: Residuals | None = None
) -> Iterator[Drawing]:
    """Draws all figures that the log has signals for, one after the other.

    Args:
        log: Of a path following run.
        outline: Lines that show what is followed, each [k, 3] m, in the frame of ``y_t``.
        fit: Where the points stand that a surface was fitted to, if it was.
    """
    if log.time.size == 0:
        return
    if "y_t" in log:
        yield draw_path(log, outline)
    if fit is not None:
        yield draw_surface_fit(fit)
    for can_draw, draw in _FIGURES:
        if can_draw(log):
            yield draw(log)


def _has(*signals: str) -> Callable[[RunLog], bool]:
    """Condition that a log has these signals."""
    return lambda log: all(signal in log for signal in signals)


def _is_along(log: RunLog) -> bool:
    """Whether there is a path or a surface to go along."""
    return "eta" in log and log["eta"].values.shape[1] < _SPACE


# In the order of the report: when a figure can be drawn, and what draws it.
_FIGURES: list[tuple[Callable[[RunLog], bool], Callable[[RunLog], Drawing]]] = [
    (_is_along, draw_progress),
    (_has("pace", "tau_planned", "tau_d"), draw_pace),
    (has_regions, draw_guidance),
    (has_contact, draw_contact),
    (gives_energy, draw_energy),
    (held_by_robot, draw_limits),
    (_has("seat_gap", "manifold_force", "damping"), draw_use_case),
    (_has("seat_gap"), draw_mounting),
    (_has("xi"), draw_transversal),
    (_has("phi"), draw_orientation),
    (_has("angles_e", "angles_d"), draw_angles),
    (_has("axis_e", "axis_d"), draw_axis),
    (has_virtual_input, draw_virtual_input),
    (has_forces, draw_forces),
    (has_varying_damping, draw_damping),
    (_has("notch_position"), draw_notch_position),
    (_has("normal_force", "xi"), draw_pressing),
    (_has("normal_force", "eta"), draw_force_map),
    (has_pushes, draw_pushes),
    (_has("q_J"), draw_positions),
    (_has("q_J", "q_posture"), draw_posture),
    (has_conditioning, draw_conditioning),
    (_has("v_J"), draw_velocities),
    (_has("tau_d"), draw_efforts),
    (_has("tau_f", "v_J"), draw_friction),
    (_has("tau_f", "friction_estimate"), draw_friction_estimate),
    (_has("momentum", "f_c", "f_v"), draw_friction_coefficients),
    (_has("q_M", "q_J"), draw_deflection),
]
