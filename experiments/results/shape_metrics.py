"""Metrics of a path's shape."""

import math

from experiments.results.metrics import Metrics
from pfsc_drake.geometry import ShapeReport


def shape_metrics(shape: ShapeReport) -> Metrics:
    """Return the numbers of a path's shape that exist, in SI units.

    Args:
        shape: From :func:`shape_report`.
    """
    metrics = Metrics()
    metrics.add("path_length", shape.length, "m")
    if math.isfinite(shape.smallest_radius):
        metrics.add("path_smallest_radius", shape.smallest_radius, "m")
        metrics.add("path_smallest_radius_at", shape.smallest_radius_at, "m")
    if shape.distance_from_points is not None:
        metrics.add("path_distance_from_points", shape.distance_from_points, "m")
    if shape.largest_angle_rate is not None:
        metrics.add("path_angle_rate", shape.largest_angle_rate, "rad/m")
    return metrics
