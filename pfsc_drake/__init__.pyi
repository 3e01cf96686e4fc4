from pfsc_drake.codegen.c_project import export as export
from pfsc_drake.control.compliance.impedance_parameters import (
    CoordinateImpedance as CoordinateImpedance,
)
from pfsc_drake.control.compliance.impedance_parameters import (
    ImpedanceParameters as ImpedanceParameters,
)
from pfsc_drake.control.compliance.impedance_parameters import (
    Profile as Profile,
)
from pfsc_drake.control.compliance.impedance_parameters import (
    SlowEnds as SlowEnds,
)
from pfsc_drake.control.compliance.pressing import PressParameters as PressParameters
from pfsc_drake.control.compliance.tuned_impedance import TuningParameters as TuningParameters
from pfsc_drake.control.estimation.link_deviation import StateUncertainty as StateUncertainty
from pfsc_drake.control.fixtures.fixture_parameters import (
    Admittance as Admittance,
)
from pfsc_drake.control.fixtures.fixture_parameters import (
    Fixture as Fixture,
)
from pfsc_drake.control.fixtures.fixture_parameters import (
    GuidanceParameters as GuidanceParameters,
)
from pfsc_drake.control.fixtures.fixture_parameters import (
    RobotLimitParameters as RobotLimitParameters,
)
from pfsc_drake.control.fixtures.fixture_parameters import (
    TankParameters as TankParameters,
)
from pfsc_drake.control.fixtures.guides import Guide as Guide
from pfsc_drake.control.law.reference import (
    rest_to_rest as rest_to_rest,
)
from pfsc_drake.control.law.reference import (
    straight_lines as straight_lines,
)
from pfsc_drake.control.law.swing import Swing as Swing
from pfsc_drake.control.law.timed_reference import StreamLimits as StreamLimits
from pfsc_drake.control.obstacles.elbow_clearance import ElbowParameters as ElbowParameters
from pfsc_drake.control.obstacles.shapes import (
    Capsule as Capsule,
)
from pfsc_drake.control.obstacles.shapes import (
    ObstacleShape as ObstacleShape,
)
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters as WatchParameters
from pfsc_drake.control.streams.messages import WaypointSender as WaypointSender
from pfsc_drake.control.streams.stream_parameters import StreamParameters as StreamParameters
from pfsc_drake.controller.controller import Controller as Controller
from pfsc_drake.controller.extension import Extension as Extension
from pfsc_drake.controller.follower import Follower as Follower
from pfsc_drake.controller.hand_guiding import (
    GuidanceOptions as GuidanceOptions,
)
from pfsc_drake.controller.hand_guiding import (
    add_guidance as add_guidance,
)
from pfsc_drake.controller.options.compliance_parameters import (
    ComplianceParameters as ComplianceParameters,
)
from pfsc_drake.controller.options.compliance_parameters import (
    ObservedForceParameters as ObservedForceParameters,
)
from pfsc_drake.controller.options.controller_parameters import (
    ControllerParameters as ControllerParameters,
)
from pfsc_drake.controller.options.controller_parameters import (
    ExternalTorqueParameters as ExternalTorqueParameters,
)
from pfsc_drake.controller.options.controller_parameters import (
    GainParameters as GainParameters,
)
from pfsc_drake.controller.options.controller_parameters import (
    LawGains as LawGains,
)
from pfsc_drake.controller.options.controller_parameters import (
    PostureParameters as PostureParameters,
)
from pfsc_drake.controller.options.follower_options import (
    BrakeParameters as BrakeParameters,
)
from pfsc_drake.controller.options.follower_options import (
    FaultParameters as FaultParameters,
)
from pfsc_drake.controller.options.follower_options import (
    FixtureOptions as FixtureOptions,
)
from pfsc_drake.controller.options.follower_options import (
    FollowerOptions as FollowerOptions,
)
from pfsc_drake.controller.options.follower_options import (
    ObstacleOptions as ObstacleOptions,
)
from pfsc_drake.controller.options.follower_options import (
    OperatorOptions as OperatorOptions,
)
from pfsc_drake.controller.options.friction_parameters import (
    FrictionCompensationParameters as FrictionCompensationParameters,
)
from pfsc_drake.controller.options.friction_parameters import (
    JointFrictionParameters as JointFrictionParameters,
)
from pfsc_drake.controller.options.friction_parameters import (
    KalmanParameters as KalmanParameters,
)
from pfsc_drake.controller.options.motion_limits import MotionLimits as MotionLimits
from pfsc_drake.controller.path_following import add_path_following as add_path_following
from pfsc_drake.controller.path_streaming import add_path_streaming as add_path_streaming
from pfsc_drake.controller.sensed_force import (
    Payload as Payload,
)
from pfsc_drake.controller.sensed_force import (
    SensedForce as SensedForce,
)
from pfsc_drake.controller.surface_following import add_surface_following as add_surface_following
from pfsc_drake.errors import InputError as InputError
from pfsc_drake.geometry import (
    Curve as Curve,
)
from pfsc_drake.geometry import (
    FourierCurve as FourierCurve,
)
from pfsc_drake.geometry import (
    OrientationCurve as OrientationCurve,
)
from pfsc_drake.geometry import (
    Path as Path,
)
from pfsc_drake.geometry import (
    PiecewisePolynomialCurve as PiecewisePolynomialCurve,
)
from pfsc_drake.geometry import (
    ScatteredFitOptions as ScatteredFitOptions,
)
from pfsc_drake.geometry import (
    Surface as Surface,
)
from pfsc_drake.geometry import (
    Tolerance as Tolerance,
)
from pfsc_drake.geometry import (
    Turned as Turned,
)
from pfsc_drake.geometry import (
    WaypointTable as WaypointTable,
)
from pfsc_drake.geometry import (
    cone as cone,
)
from pfsc_drake.geometry import (
    cylinder as cylinder,
)
from pfsc_drake.geometry import (
    extruded_surface as extruded_surface,
)
from pfsc_drake.geometry import (
    find_edges as find_edges,
)
from pfsc_drake.geometry import (
    fit_scattered as fit_scattered,
)
from pfsc_drake.geometry import (
    interpolate as interpolate,
)
from pfsc_drake.geometry import (
    interpolate_orientation as interpolate_orientation,
)
from pfsc_drake.geometry import (
    paraboloid as paraboloid,
)
from pfsc_drake.geometry import (
    path_from_waypoints as path_from_waypoints,
)
from pfsc_drake.geometry import (
    plane as plane,
)
from pfsc_drake.geometry import (
    read_surface_points as read_surface_points,
)
from pfsc_drake.geometry import (
    read_waypoints as read_waypoints,
)
from pfsc_drake.geometry import (
    smooth_surface_near_grid as smooth_surface_near_grid,
)
from pfsc_drake.geometry import (
    sphere as sphere,
)
from pfsc_drake.geometry import (
    surface_of_revolution as surface_of_revolution,
)
from pfsc_drake.geometry import (
    surface_through_grid as surface_through_grid,
)
from pfsc_drake.geometry import (
    torus as torus,
)
from pfsc_drake.geometry import (
    translated_surface as translated_surface,
)
from pfsc_drake.geometry.regions.moving import (
    CurveCourse as CurveCourse,
)
from pfsc_drake.geometry.regions.moving import (
    CurveMotion as CurveMotion,
)
from pfsc_drake.geometry.regions.moving import (
    MovingRegion as MovingRegion,
)
from pfsc_drake.geometry.regions.moving import (
    ShiftedRegion as ShiftedRegion,
)
from pfsc_drake.geometry.regions.moving import (
    TurningRegion as TurningRegion,
)
from pfsc_drake.geometry.regions.region import Region as Region
from pfsc_drake.geometry.regions.surface_region import SurfaceRegion as SurfaceRegion
from pfsc_drake.geometry.shapes.cone import ConeRegion as ConeRegion
from pfsc_drake.geometry.shapes.cylinder import CylinderRegion as CylinderRegion
from pfsc_drake.geometry.shapes.paraboloid import ParaboloidRegion as ParaboloidRegion
from pfsc_drake.geometry.shapes.plane import HalfSpace as HalfSpace
from pfsc_drake.geometry.shapes.polyhedron import PolyhedronRegion as PolyhedronRegion
from pfsc_drake.geometry.shapes.polyhedron import box_corners as box_corners
from pfsc_drake.geometry.shapes.profiles import ExtrudedRegion as ExtrudedRegion
from pfsc_drake.geometry.shapes.profiles import RevolvedRegion as RevolvedRegion
from pfsc_drake.geometry.shapes.sphere import SphereRegion as SphereRegion
from pfsc_drake.geometry.shapes.torus import TorusRegion as TorusRegion
from pfsc_drake.physics.friction import FrictionDrift as FrictionDrift
from pfsc_drake.robot.models.actuators import add_actuators as add_actuators
from pfsc_drake.robot.models.files import models_directory as models_directory
from pfsc_drake.systems.fuse import fuse as fuse

__version__: str
