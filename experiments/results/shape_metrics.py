"""Metrics of the shape of a path or a surface."""

import math

from pfsc_drake.geometry import ShapeReport
from pfsc_drake.geometry.surfaces.report import SurfaceReport
from pfsc_drake.geometry.surfaces.residuals import Residuals
from reporting.metrics import Metrics


def shape_metrics(
    shape: ShapeReport | SurfaceReport | None, fit: Residuals | None = None
) -> Metrics:
    """Return the numbers of a path's or a surface's shape that exist, in SI units.

    Args:
        shape: From :func:`shape_report` or :func:`surface_report`.
        fit: Where the points stand that a surface was fitted to, if it was.
    """
    metrics = Metrics()
    if isinstance(shape, SurfaceReport):
        metrics.add("surface_area", shape.area, "m^2")
        for side in ("outside", "inside"):
            radius = getattr(shape, f"radius_{side}")
            if math.isfinite(radius):
                metrics.add(f"surface_smallest_radius_{side}", radius, "m")
        if fit is not None:
            metrics.add("surface_fit_rms", fit.rms, "m")
            metrics.add("surface_fit_max", fit.largest, "m")
        return metrics
    if shape is None:
        return metrics
    metrics.add("path_length", shape.length, "m")
    if math.isfinite(shape.smallest_radius):
        metrics.add("path_smallest_radius", shape.smallest_radius, "m")
        metrics.add("path_smallest_radius_at", shape.smallest_radius_at, "m")
    if shape.distance_from_points is not None:
        metrics.add("path_distance_from_points", shape.distance_from_points, "m")
    if shape.distance_from_polygon is not None:
        metrics.add("path_distance_from_polygon", shape.distance_from_polygon, "m")
    if shape.largest_angle_rate is not None:
        metrics.add("path_angle_rate", shape.largest_angle_rate, "rad/m")
    return metrics
