"""Path or surface in space, its shape, and the motion of the tool."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

import numpy as np

from diagrams.station import Station
from experiments.results.coordinates_feature import measures_truth
from experiments.results.feature import Feature, Raw
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.geometry import ShapeReport
from pfsc_drake.geometry.surfaces.penalized_surface import Residuals
from pfsc_drake.geometry.surfaces.regularity import SurfaceReport
from reporting import style
from reporting.metrics import Metrics

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]

ARROW_COUNT = 5
ELEVATION = 28.0  # degrees, of the viewer
_BINS = 40
_BORDER = 1.05  # of the largest distance


def shape_metrics(
    shape: ShapeReport | SurfaceReport | None, fit: Residuals | None = None
) -> Metrics:
    """Return the metrics of a path's or surface's shape.

    Args:
        shape: From :func:`shape_report` or :func:`surface_report`.
        fit: Residuals of the points that a surface was fitted to, if any.
    """
    metrics = Metrics()
    if isinstance(shape, SurfaceReport):
        metrics.add("surface_area", shape.area)
        if math.isfinite(shape.radius_outside):
            metrics.add("surface_smallest_radius_outside", shape.radius_outside)
        if math.isfinite(shape.radius_inside):
            metrics.add("surface_smallest_radius_inside", shape.radius_inside)
        if fit is not None:
            metrics.add("surface_fit_rms", fit.rms)
            metrics.add("surface_fit_max", fit.largest)
        return metrics
    if shape is None:
        return metrics
    metrics.add("path_length", shape.length)
    if math.isfinite(shape.smallest_radius):
        metrics.add("path_smallest_radius", shape.smallest_radius)
        metrics.add("path_smallest_radius_at", shape.smallest_radius_at)
    if shape.distance_from_points is not None:
        metrics.add("path_distance_from_points", shape.distance_from_points)
    if shape.distance_from_polygon is not None:
        metrics.add("path_distance_from_polygon", shape.distance_from_polygon)
    if shape.largest_angle_rate is not None:
        metrics.add("path_angle_rate", shape.largest_angle_rate)
    return metrics


def draw_path(log: RunLog, outline: Sequence[FloatArray]) -> style.Drawing:
    """Draw path and tool point with start, end and direction of travel, with equal scales.

    Args:
        log: With ``y_t`` [samples, 3] m.
        outline: Lines that show the path or surface, each [k, 3] m; a single line for a path.
    """
    canvas = style.make_canvas(style.WIDTH, 5.6)
    axes = cast("Axes3D", canvas.add_subplot(projection="3d", computed_zorder=False))
    output = log["y_t"].values
    output = output[np.all(np.isfinite(output), axis=1)]
    lines = [np.asarray(line, dtype=float).reshape(-1, 3) for line in outline]
    floor = _set_equal_scales(axes, np.vstack([*lines, output]))
    comes = "way_left" in log  # as waypoints
    if len(lines) == 1 or comes:
        for i, line in enumerate(lines):
            axes.plot(*line[:, :2].T, floor, color="#D1D5DB", linewidth=1.0, zorder=1)
            name = "waypoints" if comes else "path $\\gamma$"
            axes.plot(*line.T, label=None if i else name, zorder=2, **style.BROAD)
    for i, line in enumerate([] if comes else lines[1:] and lines):
        label = None if i else r"surface $\mathcal{S}$"
        axes.plot(*line.T, color=style.REFERENCE, linewidth=0.7, label=label, zorder=2)
    axes.plot(*output.T, color="C0", linewidth=1.6, label="tool point $y_t$", zorder=3)
    _draw_direction(axes, output)
    for row, marker, label in ((0, "oC2", "start"), (-1, "sC1", "end")) if len(output) else ():
        point = output[row][:, np.newaxis]
        axes.plot(*point, marker, mec="white", markersize=10, label=label, zorder=5)
    for artist in (*axes.lines, *axes.collections):
        # a wide box reaches beyond the square that is called the axes
        artist.set_clip_on(False)
        artist.set_in_layout(False)
    axes.set_xlabel("x in m", labelpad=12)
    axes.set_ylabel("y in m", labelpad=8)
    axes.set_zlabel("z in m", labelpad=4)
    canvas.legend(loc="outside upper left", ncols=4, handlelength=1.6, columnspacing=1.4)
    if comes:
        caption = "Waypoints, joined by lines, their projection on the floor, and the tool point."
        return style.Drawing("path", "Waypoints and tool point", caption, canvas)
    if len(lines) > 1:
        caption = "Parameter lines of the surface, and motion of the tool point."
        return style.Drawing("path", "Surface and tool point", caption, canvas)
    caption = "Path, its projection on the floor, and motion of the tool point."
    return style.Drawing("path", "Path and tool point", caption, canvas)


def _set_equal_scales(axes: "Axes3D", points: FloatArray) -> float:
    """Set limits around all points, equal scales, few ticks and a light background.

    Returns:
        Lower limit of z [m], where the path's projection is drawn.
    """
    from matplotlib.ticker import MaxNLocator

    low, high = points.min(axis=0), points.max(axis=0)
    # A flat path still needs a box with some depth.
    span = np.maximum(high - low, 0.35 * max(float(np.max(high - low)), 1e-3)) * 1.1
    centre = 0.5 * (low + high)
    low, high = centre - span / 2, centre + span / 2
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    # the longer side runs across the picture
    azimuth = -58.0 if span[0] >= span[1] else -28.0
    axes.view_init(elev=ELEVATION, azim=azimuth)
    axes.set_box_aspect(span, zoom=_zoom(span, azimuth))
    for axis, share in zip((axes.xaxis, axes.yaxis, axes.zaxis), span / span.max(), strict=True):
        axis.set_major_locator(MaxNLocator(nbins=max(2, round(6 * share))))
        axis.set_pane_color((0.975, 0.98, 0.985, 1.0))
        axis.line.set_color(style.REFERENCE)
    return float(low[2])


def _zoom(span: FloatArray, azimuth: float) -> float:
    """Return the zoom at which a box fills the picture with its labels inside."""
    x, y, z = span / np.linalg.norm(span)
    sin_a, cos_a = np.abs([np.sin(np.deg2rad(azimuth)), np.cos(np.deg2rad(azimuth))])
    sin_e, cos_e = np.sin(np.deg2rad(ELEVATION)), np.cos(np.deg2rad(ELEVATION))
    width, height = x * sin_a + y * cos_a, z * cos_e + (x * cos_a + y * sin_a) * sin_e
    return float(min(0.87 / height, 1.2 / width))


def _draw_direction(axes: "Axes3D", output: FloatArray) -> None:
    """Draw arrow heads along the path, at equal distances."""
    steps = np.linalg.norm(np.diff(output, axis=0), axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    if travelled[-1] == 0.0:
        return
    size = 0.03 * float(np.max(np.ptp(output, axis=0)))
    for share in np.linspace(0.0, 1.0, ARROW_COUNT + 2)[1:-1]:
        target = share * travelled[-1]
        here, ahead = (
            np.array([np.interp(s, travelled, column) for column in output.T])
            for s in (target, target + 0.5 * size)
        )
        direction = ahead - here
        norm = float(np.linalg.norm(direction))
        if norm > 0.0:
            axes.quiver(
                *here,
                *(size * direction / norm),
                color=style.INK,
                arrow_length_ratio=1.0,
                linewidth=2.0,
                zorder=4,
            )


def draw_surface_fit(fit: Residuals) -> style.Drawing:
    """Draw distances of points from a fitted surface: map and histogram.

    Args:
        fit: Residuals of the points.
    """
    scale, unit = style.fitting_unit(fit.distances, "m")
    distances, reach = scale * fit.distances, _BORDER * scale * fit.largest or 1.0
    canvas = style.make_canvas(style.WIDTH, 4.2)
    over, counted = canvas.subplots(1, 2, width_ratios=(3, 2))
    dots = over.scatter(
        *fit.theta.T, c=distances, s=8.0, cmap="RdBu_r", vmin=-reach, vmax=reach, linewidths=0.0
    )
    canvas.colorbar(dots, ax=over, label=f"distance in {unit}")
    over.set(xlabel=r"$\theta_1$", ylabel=r"$\theta_2$", title="Over the surface")
    over.grid(visible=False)
    counted.hist(distances, bins=_BINS, range=(-reach, reach), color="C0")
    for sign in (-1.0, 1.0):
        label = f"root mean square {scale * fit.rms:.3g} {unit}" if sign > 0.0 else None
        counted.axvline(sign * scale * fit.rms, linestyle="--", color=style.INK, label=label)
    counted.set(xlabel=f"distance in {unit}", ylabel="points", title=" ")
    counted.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.0)
    caption = (
        f"Distances of {len(distances)} points from the fitted surface along its normal, at most "
        f"{np.abs(distances).max():.3g} {unit}; they should show no pattern."
    )
    return style.Drawing("surface_fit", "Points and the surface fitted to them", caption, canvas)


def add_tool(log: RunLog, station: Station, raw: Raw) -> None:
    """Add the actual pose of the tool, and the controller's measurement.

    Args:
        log: Log of the run, which is extended.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    poses = {"": raw["true_pose"]}
    if not measures_truth(station, raw):
        poses["_measured"] = raw["tool_pose"]
    for suffix, pose in poses.items():
        log.add(f"y_t{suffix}", pose[:, :3])
        log.add(f"R_e{suffix}", pose[:, 3:])


FEATURE = Feature(
    signals=add_tool,
    metrics=lambda log, station, settings: shape_metrics(station.task.shape, station.task.fit),
    known=lambda station, settings: shape_metrics(station.task.shape, station.task.fit),
)
