"""Figures of a path following run, after Fig. 3.9-3.12 of the dissertation."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from experiments.figure_path import draw_path
from experiments.figure_style import (
    ALERT,
    COLOURS,
    INK,
    REFERENCE,
    STYLE,
    Figure,
    draw_components,
    make_panels,
    place_legend,
    save_canvas,
)
from experiments.path_metrics import path_distance
from experiments.run_log import FloatArray, RunLog

MILLI = 1e3
BROAD: dict[str, Any] = {"color": "#9CA3AF", "linewidth": 4.0, "alpha": 0.6}  # under its follower
DISTANCE_FLOOR = 1e-9  # m; zero has no place on a logarithmic axis


def write_figures(log: RunLog, path_points: FloatArray, directory: Path) -> list[Figure]:
    """Writes all figures that the log has signals for.

    Args:
        log: Of a path following run.
        path_points: [k, 3] m, points of the path in order, in the frame of ``y_t``.
        directory: Folder for the PNG files; created if missing.

    Returns:
        The figures in the order of the report.
    """
    directory.mkdir(parents=True, exist_ok=True)
    figures = []
    with matplotlib.rc_context(STYLE):
        for name, needed, title, caption, draw in _figure_table():
            if log.time.size == 0 or not all(signal in log for signal in needed):
                continue
            path = directory / f"{name}.png"
            canvas = draw_path(log, path_points) if draw is None else draw(log)
            save_canvas(canvas, path)
            figures.append(Figure(path, title, caption))
    return figures


def draw_progress(log: RunLog) -> Canvas:
    """Tangential coordinate with its reference, its error, and the speed, if logged."""
    reference = log["eta_p"].values[:, 0] if "eta_p" in log else None
    rows = 1 + (reference is not None) + ("eta_dot" in log)
    canvas, panels = make_panels(rows)
    eta = log["eta"].values[:, 0]
    if reference is not None:
        panels[0].plot(log.time, reference, label=r"$\eta^p$ (reference)", **BROAD)
        panels[1].plot(log.time, MILLI * (eta - reference), color=COLOURS[1])
        panels[1].set(ylabel="error in mm", title=r"Tangential error $\eta - \eta^p$")
    panels[0].plot(log.time, eta, color=COLOURS[0], label=r"$\eta$")
    place_legend(panels[0])
    panels[0].set(ylabel="arc length in m", title="Position along the path")
    if "eta_dot" in log:
        panels[-1].plot(log.time, log["eta_dot"].values[:, 0], color=COLOURS[0])
        panels[-1].set(ylabel="speed in m/s", title=r"Speed along the path $\dot\eta$")
    return canvas


def draw_transversal(log: RunLog) -> Canvas:
    """Transversal coordinates: whole range, what is left after convergence, log distance."""
    canvas, panels = make_panels(3)
    xi = MILLI * log["xi"].values
    labels = [r"$\xi_1$", r"$\xi_2$"][: xi.shape[1]]
    for panel in panels[:2]:
        panel.axhline(0.0, color=REFERENCE, linewidth=0.8)
        draw_components(panel, log.time, xi, labels)
        if "xi_p" in log and np.any(log["xi_p"].values):
            names = [f"{label} reference" for label in labels]
            draw_components(panel, log.time, MILLI * log["xi_p"].values, names, ":")
    panels[0].set(ylabel="deviation in mm", title="Transversal coordinates")
    place_legend(panels[0])
    late = xi[log.time >= log.time[0] + 0.25 * (log.time[-1] - log.time[0])]
    span = 1.2 * float(np.nanmax(np.abs(late))) if np.any(np.isfinite(late)) else 0.0
    if span > 0.0:
        panels[1].set_ylim(-span, span)
    panels[1].set(ylabel="deviation in mm", title="The same, scaled to the last three quarters")
    distance = np.maximum(path_distance(log), DISTANCE_FLOOR)
    panels[2].semilogy(log.time, MILLI * distance, color=INK, linewidth=1.2)
    panels[2].set(ylabel="distance in mm", title=r"Distance from the path $\|\xi\|$")
    return canvas


def draw_velocities(log: RunLog) -> Canvas:
    """Joint velocities, motor velocities, and their difference where both are logged."""
    names = [name for name in ("v_J", "v_M") if name in log]
    both = len(names) == 2
    canvas, panels = make_panels(len(names) + both)
    titles = {"v_J": r"Joint velocities $\dot q_J$", "v_M": r"Motor velocities $\dot q_M$"}
    for panel, name in zip(panels, names, strict=False):
        signal = log[name]
        draw_components(panel, log.time, signal.values, _axis_labels(signal.dim))
        panel.set(ylabel=f"velocity in {signal.unit}", title=titles[name])
    if both:
        difference = log["v_M"].values - log["v_J"].values
        draw_components(panels[2], log.time, difference, _axis_labels(difference.shape[1]))
        title = r"Difference $\dot q_M - \dot q_J$"
        panels[2].set(ylabel=f"velocity in {log['v_M'].unit}", title=title)
    place_legend(panels[0])
    return canvas


def draw_torques(log: RunLog) -> Canvas:
    """Drive torques, three axes per panel, with limits (dashed) that are near enough to matter."""
    signal = log["tau_d"]
    groups = [range(i, min(i + 3, signal.dim)) for i in range(0, signal.dim, 3)]
    canvas, panels = make_panels(len(groups), height=2.9)
    labels = _axis_labels(signal.dim)
    for panel, group in zip(panels, groups, strict=True):
        for axis in group:
            colour = COLOURS[axis % len(COLOURS)]
            torque = signal.values[:, axis]
            panel.plot(log.time, torque, color=colour, label=labels[axis])
            if signal.limits is not None:
                _draw_limit(panel, float(signal.limits[axis]), torque, colour)
        title = f"Drive torques {labels[group[0]]} to {group[-1] + 1}"
        panel.set(ylabel=f"torque in {signal.unit}", title=title)
        place_legend(panel)
    return canvas


def draw_orientation(log: RunLog) -> Canvas:
    """Orientation errors: components and, on a logarithmic scale, their norm."""
    canvas, panels = make_panels(2)
    phi = MILLI * log["phi"].values
    labels = [r"$\varphi$", r"$\vartheta$", r"$\psi$"]
    if phi.shape[1] != 3:
        labels = log["phi"].labels
    panels[0].axhline(0.0, color=REFERENCE, linewidth=0.8)
    draw_components(panels[0], log.time, phi, labels)
    panels[0].set(ylabel="angle in mrad", title="Orientation error")
    place_legend(panels[0])
    norm = np.maximum(np.linalg.norm(phi, axis=1), MILLI * DISTANCE_FLOOR)
    panels[1].semilogy(log.time, norm, color=INK, linewidth=1.2)
    panels[1].set(ylabel="norm in mrad", title=r"Size of the orientation error $\|\phi\|$")
    return canvas


def draw_deflection(log: RunLog) -> Canvas:
    """Deflection of the elastic joints."""
    canvas, (panel,) = make_panels(1, height=3.2)
    deflection = MILLI * (log["q_M"].values - log["q_J"].values)
    panel.axhline(0.0, color=REFERENCE, linewidth=0.8)
    draw_components(panel, log.time, deflection, _axis_labels(deflection.shape[1]))
    panel.set(ylabel=f"deflection in m{log['q_M'].unit}", title=r"Deflection $q_M - q_J$")
    place_legend(panel)
    return canvas


Draw = Callable[[RunLog], Canvas]


def _figure_table() -> list[tuple[str, tuple[str, ...], str, str, Draw | None]]:
    """File name, signals needed, title, caption and drawing of each figure; None is the path."""
    return [
        ("path", ("y_t",), "Path and driven output", "The path and the tool point's way.", None),
        (
            "progress",
            ("eta",),
            "Progress along the path",
            "Tangential coordinate against its reference, the error between them, and the speed.",
            draw_progress,
        ),
        (
            "transversal",
            ("xi",),
            "Deviation from the path",
            "Transversal coordinates, enlarged once converged, and the distance from the path.",
            draw_transversal,
        ),
        (
            "orientation",
            ("phi",),
            "Orientation error",
            "Roll, pitch and yaw of the tool against the orientation that belongs to its place.",
            draw_orientation,
        ),
        (
            "velocities",
            ("v_J",),
            "Joint and motor velocities",
            "They differ where the drive torque is high, through the elastic transmissions.",
            draw_velocities,
        ),
        (
            "torques",
            ("tau_d",),
            "Drive torques",
            "Commanded torques; dashed lines are limits of the drives within reach.",
            draw_torques,
        ),
        (
            "deflection",
            ("q_M", "q_J"),
            "Joint deflection",
            "Twist of the elastic transmissions, motor angle less joint angle.",
            draw_deflection,
        ),
    ]


def _axis_labels(count: int) -> list[str]:
    """Labels ``axis 1`` and so on."""
    return [f"axis {i + 1}" for i in range(count)]


def _draw_limit(panel: Axes, limit: float, torque: FloatArray, colour: str) -> None:
    """Dashed lines at a limit that the torque comes within a factor of two of."""
    peak = float(np.nanmax(np.abs(torque))) if np.any(np.isfinite(torque)) else 0.0
    if np.isfinite(limit) and peak >= 0.5 * limit:
        at_limit = peak >= limit * (1.0 - 1e-9)
        for sign in (-1.0, 1.0):
            panel.axhline(
                sign * limit, linestyle="--", color=ALERT if at_limit else colour, linewidth=1.0
            )
