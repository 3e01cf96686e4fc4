"""Figures of a taught path."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from experiments.results.run_log import FloatArray
from experiments.teaching.comparison import Fit, FollowedShape, line_of
from experiments.teaching.taught_path import Taught
from pfsc_drake.geometry import Path, matrix_to_zyx, quaternion_to_matrix
from reporting.style import (
    BROAD,
    COLOURS,
    INK,
    STYLE,
    WIDTH,
    Drawing,
    Figure,
    add_legend,
    draw_components,
    make_panels,
    render,
)

_MILLI = 1e3
_AXES = ["x", "y", "z"]


def draw_pictures(taught: Taught, fit: Fit, followed: FollowedShape | None) -> list[Figure]:
    """Return the figures of a page.

    Args:
        taught: The path.
        fit: Its fit.
        followed: The run along it, or None.
    """
    with plt.rc_context(STYLE):
        drawings = [_draw_paths(taught, followed), _draw_distances(fit, followed)]
        drawings.append(_draw_shape(taught, fit))
        return [render(drawing) for drawing in drawings]


def _draw_paths(taught: Taught, followed: FollowedShape | None) -> Drawing:
    """Draw waypoints, fitted path and tool, from above and from the side."""
    line, points = line_of(taught.path), taught.table.positions
    canvas = Canvas(figsize=(WIDTH, 6.2))
    across = int(np.argmin(np.ptp(points, axis=0)[:2]))
    along = 1 - across
    views = [(along, across, "From above"), (along, 2, "From the side")]
    for panel, (i, j, title) in zip(canvas.subplots(2, 1), views, strict=True):
        panel.plot(line[:, i], line[:, j], label="fitted path", **BROAD)
        label = "tool following it"
        if followed is not None:
            panel.plot(followed.y_t[:, i], followed.y_t[:, j], color=COLOURS[0], label=label)
        panel.plot(
            points[:, i], points[:, j], ".", color=COLOURS[1], markersize=4, label="waypoints"
        )
        panel.set(title=title, xlabel=f"{_AXES[i]} in m", ylabel=f"{_AXES[j]} in m")
        panel.set_aspect("equal", adjustable="datalim")
        add_legend(panel)
    caption = (
        "Waypoints are tool positions measured by encoders and model during hand guiding; the tool "
        "that follows is drawn at its actual position, displaced by the model's error."
    )
    return Drawing("taught", "Taught, fitted and followed", caption, canvas)


def _draw_distances(fit: Fit, followed: FollowedShape | None) -> Drawing:
    """Draw distances of waypoints from the path, and errors of the tool."""
    canvas, panels = make_panels(2 if followed is not None else 1, 2.6, common_time=False)
    panels[0].plot(fit.eta, _MILLI * fit.distances, ".-", color=COLOURS[1], linewidth=0.8)
    panels[0].set(title="Waypoints from the fitted path", ylabel="distance in mm")
    if followed is not None:
        lines = {
            "position error of the model": followed.error,
            "distance from taught position": followed.repeated,
            "measured distance from the path": followed.measured,
            "change of that error since teaching": followed.error_change,
        }
        for colour, (label, values) in zip(COLOURS, lines.items(), strict=False):
            panels[1].plot(followed.eta, _MILLI * values, color=colour, label=label)
        panels[1].set(title="The tool", ylabel="distance in mm", yscale="log")
        low = max(1e-4, 0.5 * _MILLI * float(np.quantile(followed.error_change, 0.05)))
        panels[1].set_ylim(bottom=low)
        add_legend(panels[1], columns=2)
    panels[-1].set_xlabel(r"$\eta$ in m")
    caption = (
        "Above: corners, stops and tremor of the operator's hand, which the fit smooths. Below: "
        "distance of actual from measured tool point, with its change since teaching; distance "
        "from "
        "the taught position; and distance from the path."
    )
    return Drawing("distances", "Distances", caption, canvas)


def _draw_shape(taught: Taught, fit: Fit) -> Drawing:
    """Draw curvature before and after the fit, and the orientation."""
    oriented = taught.table.quaternions is not None
    canvas, panels = make_panels(2 if oriented else 1, 2.6, common_time=False)
    if fit.through is not None:
        _draw_curvature(panels[0], fit.through, "through all waypoints", COLOURS[1])
    _draw_curvature(panels[0], taught.path, "fitted", COLOURS[0])
    panels[0].set(title="Curvature", ylabel="1/m", yscale="log")
    panels[0].set_ylim(bottom=0.3)
    add_legend(panels[0])
    if oriented:
        _draw_angles(panels[1], taught, fit)
    panels[-1].set_xlabel(r"$\eta$ in m")
    caption = "Curvature of the path before and after the fit, and its orientation."
    return Drawing("shape", "Shape of the path", caption, canvas)


def _draw_curvature(panel: Axes, path: Path, label: str, colour: str) -> None:
    begin, end = path.position.domain
    theta = np.linspace(begin, end, 4001)[1:-1]
    _, d1, d2 = path.position.derivatives(theta, 2).transpose(1, 0, 2)
    speed = np.linalg.norm(d1, axis=1)
    curvature = np.linalg.norm(np.cross(d1, d2), axis=1) / speed**3
    panel.plot(path.arc_length(theta), curvature, color=colour, label=label, linewidth=1.0)


def _draw_angles(panel: Axes, taught: Taught, fit: Fit) -> None:
    assert taught.path.orientation is not None
    assert taught.table.quaternions is not None
    begin, end = taught.path.position.domain
    theta = np.linspace(begin, end, 401)
    path = _angles_deg(taught.path.orientation.derivatives(theta, 0)[:, 0])
    labels = ["about z", "about y", "about x"]
    draw_components(panel, np.asarray(taught.path.arc_length(theta)), path, labels)
    points = _angles_deg(taught.table.quaternions)
    points += 360.0 * np.round((path[0] - points[0]) / 360.0)
    panel.plot(fit.eta, points, ".", color=INK, markersize=2.5)
    panel.set(title="ZYX angles, fitted, and of the waypoints (dots)", ylabel="deg")
    add_legend(panel)


def _angles_deg(quaternions: FloatArray) -> FloatArray:
    return np.rad2deg(np.unwrap(matrix_to_zyx(quaternion_to_matrix(quaternions)), axis=0))
