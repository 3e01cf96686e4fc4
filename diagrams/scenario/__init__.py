"""Format of scenario files, one file per block."""

from diagrams.scenario.holder import HolderParameters, HolderWorkpiece, SolidParameters
from diagrams.scenario.manifolds import PathParameters, SurfaceParameters
from diagrams.scenario.model_error import ModelErrorParameters, RandomModelError
from diagrams.scenario.motion import ReferenceParameters, StartParameters
from diagrams.scenario.robot import (
    DriverParameters,
    RobotParameters,
    SensorParameters,
    ServoParameters,
)
from diagrams.scenario.schema import Scenario, Target
from diagrams.scenario.simulation import (
    HoldBackParameters,
    SensorFailureParameters,
    SimulationParameters,
)
from diagrams.scenario.streamed import Streamed
from pfsc_drake.controller.options.compliance_parameters import ComplianceParameters
from pfsc_drake.controller.options.controller_parameters import (
    ControllerParameters,
    GainParameters,
    LawGains,
    PostureParameters,
)
from pfsc_drake.controller.options.follower_options import BrakeParameters, FaultParameters
from pfsc_drake.controller.options.friction_parameters import JointFrictionParameters
from pfsc_drake.geometry.shapes.intersection import Intersection
from pfsc_drake.geometry.shapes.on_surface import OnSurface
from pfsc_drake.geometry.shapes.path_shapes import BentLemniscate, Circle, Line
from pfsc_drake.geometry.shapes.through_waypoints import Waypoints
from pfsc_drake.geometry.shapes.tool_orientation import Keyframe, OrientationParameters
from pfsc_drake.physics.hand_model import HandParameters, HandWaypoint
from pfsc_drake.physics.joint_sensors import EncoderOptions
from pfsc_drake.physics.link_forces import LinkHandParameters
from pfsc_drake.physics.scripted_force import ForcePulse

__all__ = [
    "BentLemniscate",
    "BrakeParameters",
    "Circle",
    "ComplianceParameters",
    "ControllerParameters",
    "DriverParameters",
    "EncoderOptions",
    "FaultParameters",
    "ForcePulse",
    "GainParameters",
    "HandParameters",
    "HandWaypoint",
    "HoldBackParameters",
    "HolderParameters",
    "HolderWorkpiece",
    "Intersection",
    "JointFrictionParameters",
    "Keyframe",
    "LawGains",
    "Line",
    "LinkHandParameters",
    "ModelErrorParameters",
    "OnSurface",
    "OrientationParameters",
    "PathParameters",
    "PostureParameters",
    "RandomModelError",
    "ReferenceParameters",
    "RobotParameters",
    "Scenario",
    "SensorFailureParameters",
    "SensorParameters",
    "ServoParameters",
    "SimulationParameters",
    "SolidParameters",
    "StartParameters",
    "Streamed",
    "SurfaceParameters",
    "Target",
    "Waypoints",
]
