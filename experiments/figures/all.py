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
    draw_friction_coefficients,
    draw_friction_estimate,
    draw_pace,
    draw_velocities,
    draw_virtual_input,
    has_virtual_input,
)
from experiments.figures.fastest import draw_fastest
from experiments.figures.forces import (
    draw_damping,
    draw_force_map,
    draw_forces,
    draw_pressing,
    has_forces,
    has_varying_damping,
)
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
from experiments.figures.guides import draw_guides
from experiments.figures.links import draw_found_links
from experiments.figures.mounting import draw_mounting, draw_use_case
from experiments.figures.obstacles import draw_obstacles
from experiments.figures.path import draw_notch_position, draw_path, draw_surface_fit
from experiments.figures.posture import (
    draw_conditioning,
    draw_positions,
    draw_posture,
    draw_pushes,
    has_conditioning,
    has_pushes,
)
from experiments.figures.streaming import draw_stream
from experiments.figures.teleoperation import (
    draw_led_turns,
    draw_port_energy,
    draw_teleoperation,
)
from experiments.figures.two_arms import draw_holder_torques, draw_two_arms
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.geometry.surfaces.penalized_surface import Residuals
from reporting.registry import FIGURES
from reporting.style import STYLE, Drawing, Figure, render

_SPACE = 3  # tangential coordinates of a tool that is led freely


def render_figures(
    log: RunLog, outline: Sequence[FloatArray], fit: Residuals | None = None
) -> list[Figure]:
    """Returns all figures that the log has signals for, in the order of the report.

    Args:
        log: Log of a path following run.
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
        log: Log of a path following run.
        outline: Lines that show what is followed, each [k, 3] m, in the frame of ``y_t``.
        fit: Where the points stand that a surface was fitted to, if it was.
    """
    if log.time.size == 0:
        return
    if _has_what_it_needs("path", log):
        yield draw_path(log, outline)
    if fit is not None:
        yield draw_surface_fit(fit)
    for name, (draw, is_worth_it) in _DRAWN.items():
        if _has_what_it_needs(name, log) and is_worth_it(log):
            yield draw(log)


def _has_what_it_needs(figure: str, log: RunLog) -> bool:
    return set(FIGURES[figure].needs) <= set(log.signals)


def _always(_log: RunLog) -> bool:
    return True


def _is_along(log: RunLog) -> bool:
    """Whether there is a path or a surface to go along."""
    return log["eta"].dim < _SPACE


# in the order of the report: what draws a figure, and whether that is worth it
_DRAWN: dict[str, tuple[Callable[[RunLog], Drawing], Callable[[RunLog], bool]]] = {
    "progress": (draw_progress, _is_along),
    "pace": (draw_pace, _always),
    "stream": (draw_stream, _always),
    "fastest": (draw_fastest, _always),
    "obstacles": (draw_obstacles, _always),
    "guidance": (draw_guidance, has_regions),
    "guides": (draw_guides, _always),
    "contact": (draw_contact, has_contact),
    "energy": (draw_energy, gives_energy),
    "teleoperation": (draw_teleoperation, _always),
    "led_turns": (draw_led_turns, _always),
    "port_energy": (draw_port_energy, _always),
    "limits": (draw_limits, held_by_robot),
    "use_case": (draw_use_case, _always),
    "mounting": (draw_mounting, _always),
    "transversal": (draw_transversal, _always),
    "orientation": (draw_orientation, _always),
    "angles": (draw_angles, _always),
    "axis": (draw_axis, _always),
    "two_arms": (draw_two_arms, _always),
    "virtual_input": (draw_virtual_input, has_virtual_input),
    "forces": (draw_forces, has_forces),
    "damping": (draw_damping, has_varying_damping),
    "notch": (draw_notch_position, _always),
    "pressing": (draw_pressing, _always),
    "force_map": (draw_force_map, _always),
    "pushes": (draw_pushes, has_pushes),
    "positions": (draw_positions, _always),
    "posture": (draw_posture, _always),
    "conditioning": (draw_conditioning, has_conditioning),
    "velocities": (draw_velocities, _always),
    "drive_torques": (draw_efforts, _always),
    "holder_torques": (draw_holder_torques, _always),
    "friction": (draw_friction, _always),
    "friction_estimate": (draw_friction_estimate, _always),
    "friction_coefficients": (draw_friction_coefficients, _always),
    "deflection": (draw_deflection, _always),
    "found_links": (draw_found_links, _always),
}
