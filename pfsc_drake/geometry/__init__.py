"""Paths and surfaces in space: curves, orientations, lengths, frames, curvatures, projections.

Knows neither robots nor Drake. Numbers in parentheses are equations of the dissertation.
"""

from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.fourier import FourierCurve
from pfsc_drake.geometry.curves.orientation import OrientationCurve, interpolate_orientation
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.curves.smoothing import noise_level
from pfsc_drake.geometry.curves.spline import interpolate
from pfsc_drake.geometry.intersections.edge import Edge, find_edge, find_edges
from pfsc_drake.geometry.intersections.meeting import find_corners
from pfsc_drake.geometry.nearest import ProjectionStatus
from pfsc_drake.geometry.paths.arc_length import ArcLength
from pfsc_drake.geometry.paths.evaluator import PathEvaluator
from pfsc_drake.geometry.paths.frame import ParallelTransportFrame
from pfsc_drake.geometry.paths.path import Path, PathWaypoints
from pfsc_drake.geometry.paths.projection import Projection, Projector
from pfsc_drake.geometry.paths.shape_report import ShapeReport, shape_report
from pfsc_drake.geometry.paths.taught import Picking, pick_waypoints
from pfsc_drake.geometry.paths.waypoints import (
    Tolerance,
    WaypointTable,
    path_from_waypoints,
    read_waypoints,
    waypoints_text,
)
from pfsc_drake.geometry.point import PathPointLayout, SurfacePointLayout
from pfsc_drake.geometry.rotation import (
    angle_between,
    check_rotation_matrix,
    euler_margin,
    matrix_to_quaternion,
    matrix_to_zyx,
    matrix_to_zyz,
    quaternion_to_matrix,
    quaternion_to_zyx,
    quaternion_to_zyz,
    rotation_to_axis,
    turn_about,
    zyx_to_matrix,
    zyx_to_quaternion,
    zyz_to_matrix,
    zyz_to_quaternion,
)
from pfsc_drake.geometry.shapes.cone import cone
from pfsc_drake.geometry.shapes.cylinder import cylinder
from pfsc_drake.geometry.shapes.paraboloid import paraboloid
from pfsc_drake.geometry.shapes.plane import plane
from pfsc_drake.geometry.shapes.revolution import Turned
from pfsc_drake.geometry.shapes.sphere import sphere
from pfsc_drake.geometry.shapes.torus import torus
from pfsc_drake.geometry.surfaces.curvature import FundamentalForms, fundamental_forms
from pfsc_drake.geometry.surfaces.evaluator import SurfaceEvaluator
from pfsc_drake.geometry.surfaces.generated import (
    extruded_surface,
    surface_of_revolution,
    translated_surface,
)
from pfsc_drake.geometry.surfaces.grid import smooth_surface_near_grid, surface_through_grid
from pfsc_drake.geometry.surfaces.point_file import read_surface_points
from pfsc_drake.geometry.surfaces.product import ProductSurface
from pfsc_drake.geometry.surfaces.projection import (
    GlobalProjector,
    SurfaceProjection,
    SurfaceProjector,
)
from pfsc_drake.geometry.surfaces.regularity import SurfaceReport, surface_report
from pfsc_drake.geometry.surfaces.scattered import ScatteredFitOptions, SurfaceFit, fit_scattered
from pfsc_drake.geometry.surfaces.sheets import check_single_sheet
from pfsc_drake.geometry.surfaces.surface import (
    Surface,
    partial_count,
    partial_index,
    partial_orders,
    rotation_from_axes,
)

__all__ = [
    "ArcLength",
    "Curve",
    "Edge",
    "FourierCurve",
    "FundamentalForms",
    "GlobalProjector",
    "OrientationCurve",
    "ParallelTransportFrame",
    "Path",
    "PathEvaluator",
    "PathPointLayout",
    "PathWaypoints",
    "Picking",
    "PiecewisePolynomialCurve",
    "ProductSurface",
    "Projection",
    "ProjectionStatus",
    "Projector",
    "ScatteredFitOptions",
    "ShapeReport",
    "Surface",
    "SurfaceEvaluator",
    "SurfaceFit",
    "SurfacePointLayout",
    "SurfaceProjection",
    "SurfaceProjector",
    "SurfaceReport",
    "Tolerance",
    "Turned",
    "WaypointTable",
    "angle_between",
    "check_rotation_matrix",
    "check_single_sheet",
    "cone",
    "cylinder",
    "euler_margin",
    "extruded_surface",
    "find_corners",
    "find_edge",
    "find_edges",
    "fit_scattered",
    "fundamental_forms",
    "interpolate",
    "interpolate_orientation",
    "matrix_to_quaternion",
    "matrix_to_zyx",
    "matrix_to_zyz",
    "noise_level",
    "paraboloid",
    "partial_count",
    "partial_index",
    "partial_orders",
    "path_from_waypoints",
    "pick_waypoints",
    "plane",
    "quaternion_to_matrix",
    "quaternion_to_zyx",
    "quaternion_to_zyz",
    "read_surface_points",
    "read_waypoints",
    "rotation_from_axes",
    "rotation_to_axis",
    "shape_report",
    "smooth_surface_near_grid",
    "sphere",
    "surface_of_revolution",
    "surface_report",
    "surface_through_grid",
    "torus",
    "translated_surface",
    "turn_about",
    "waypoints_text",
    "zyx_to_matrix",
    "zyx_to_quaternion",
    "zyz_to_matrix",
    "zyz_to_quaternion",
]
