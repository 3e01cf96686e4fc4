"""Paths in space: curves, orientations, arc length, frames and projections.

Knows neither robots nor Drake. Numbers in parentheses are equations of the dissertation.
"""

from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.fourier import FourierCurve
from pfsc_drake.geometry.curves.orientation import OrientationCurve, interpolate_orientation
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.curves.smoothing import noise_level
from pfsc_drake.geometry.curves.spline import interpolate
from pfsc_drake.geometry.paths.arc_length import ArcLength
from pfsc_drake.geometry.paths.evaluator import PathEvaluator
from pfsc_drake.geometry.paths.frame import ParallelTransportFrame
from pfsc_drake.geometry.paths.path import Path, PathWaypoints
from pfsc_drake.geometry.paths.point import PathPointLayout
from pfsc_drake.geometry.paths.projection import Projection, Projector, project_globally
from pfsc_drake.geometry.paths.shape_report import ShapeReport, shape_report
from pfsc_drake.geometry.paths.waypoint_file import WaypointTable, read_waypoints
from pfsc_drake.geometry.paths.waypoints import Tolerance, path_from_waypoints
from pfsc_drake.geometry.projection_status import ProjectionStatus
from pfsc_drake.geometry.rotation import (
    angle_between,
    check_rotation_matrix,
    matrix_to_quaternion,
    matrix_to_zyx,
    matrix_to_zyz,
    quaternion_to_matrix,
    quaternion_to_zyx,
    quaternion_to_zyz,
    rotation_to_axis,
    zyx_to_matrix,
    zyx_to_quaternion,
    zyz_to_matrix,
    zyz_to_quaternion,
)

__all__ = [
    "ArcLength",
    "Curve",
    "FourierCurve",
    "OrientationCurve",
    "ParallelTransportFrame",
    "Path",
    "PathEvaluator",
    "PathPointLayout",
    "PathWaypoints",
    "PiecewisePolynomialCurve",
    "Projection",
    "ProjectionStatus",
    "Projector",
    "ShapeReport",
    "Tolerance",
    "WaypointTable",
    "angle_between",
    "check_rotation_matrix",
    "interpolate",
    "interpolate_orientation",
    "matrix_to_quaternion",
    "matrix_to_zyx",
    "matrix_to_zyz",
    "noise_level",
    "path_from_waypoints",
    "project_globally",
    "quaternion_to_matrix",
    "quaternion_to_zyx",
    "quaternion_to_zyz",
    "read_waypoints",
    "rotation_to_axis",
    "shape_report",
    "zyx_to_matrix",
    "zyx_to_quaternion",
    "zyz_to_matrix",
    "zyz_to_quaternion",
]
