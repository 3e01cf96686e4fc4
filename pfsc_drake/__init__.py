"""Path and surface following control as Drake systems.

After B. Bischof, "Path and Surface Following Control for Industrial Robotic
Applications", dissertation, TU Wien, 2018.

The doors, :func:`add_path_following`, :func:`add_path_streaming`, :func:`add_surface_following`
and :func:`add_guidance`, and what their arguments are made of. Behind it, imports only
point downwards:

* :mod:`pfsc_drake.following`: whole controllers, from the joint state to the drives.
* :mod:`pfsc_drake.codegen`: controllers as C99.
* :mod:`pfsc_drake.systems`: blocks as Drake systems, one by one or fused; plants, drawing.
* :mod:`pfsc_drake.physics`: what a controller meets and does not know.
* :mod:`pfsc_drake.control`: what a controller knows: laws, manifolds, observers, fixtures.
* :mod:`pfsc_drake.robot`: kinematics and dynamics.
* :mod:`pfsc_drake.geometry`: curves, surfaces, regions, projection, moving frames.
* :mod:`pfsc_drake.blocks`: components as expressions, and networks of them.
* :mod:`pfsc_drake.compiled`: expressions as machine code.
* :mod:`pfsc_drake.jets`: truncated Taylor arithmetic.
"""

from typing import TYPE_CHECKING

from pfsc_drake.door import door
from pfsc_drake.errors import InputError

__version__ = "0.1.0"

# what users import, and the modules that are loaded when they do
_DOOR = {
    "Capsule": "pfsc_drake.control.obstacles.shapes",
    "ComplianceParameters": "pfsc_drake.following.options.compliance",
    "ControllerParameters": "pfsc_drake.following.options.controller",
    "CoordinateImpedance": "pfsc_drake.control.compliance.impedance_parameters",
    "FaultParameters": "pfsc_drake.following.options.follower",
    "Fixture": "pfsc_drake.control.fixtures.parameters",
    "Follower": "pfsc_drake.following.follower",
    "FollowerOptions": "pfsc_drake.following.options.follower",
    "GainParameters": "pfsc_drake.following.options.controller",
    "Guide": "pfsc_drake.control.fixtures.guides",
    "GuidanceOptions": "pfsc_drake.following.guidance",
    "HalfSpace": "pfsc_drake.geometry.regions.shapes",
    "LawGains": "pfsc_drake.following.options.controller",
    "ObstacleOptions": "pfsc_drake.following.options.follower",
    "ObstacleShape": "pfsc_drake.control.obstacles.shapes",
    "Path": "pfsc_drake.geometry",
    "Profile": "pfsc_drake.control.compliance.impedance_parameters",
    "SphereRegion": "pfsc_drake.geometry.regions.shapes",
    "StreamLimits": "pfsc_drake.control.law.timed_reference",
    "StreamParameters": "pfsc_drake.control.streams.parameters",
    "WatchParameters": "pfsc_drake.control.obstacles.parameters",
    "WaypointSender": "pfsc_drake.control.streams.messages",
    "WaypointTable": "pfsc_drake.geometry",
    "add_actuators": "pfsc_drake.robot.models.actuators",
    "add_guidance": "pfsc_drake.following.guidance",
    "add_path_following": "pfsc_drake.following.path_following",
    "add_path_streaming": "pfsc_drake.following.streaming",
    "add_surface_following": "pfsc_drake.following.surface_following",
    "export": "pfsc_drake.codegen.export",
    "fuse": "pfsc_drake.systems.fuse",
    "models_directory": "pfsc_drake.robot.models.files",
    "path_from_waypoints": "pfsc_drake.geometry",
    "rest_to_rest": "pfsc_drake.control.law.reference",
    "straight_lines": "pfsc_drake.control.law.reference",
}

if TYPE_CHECKING:  # what type checkers see of the same
    from pfsc_drake.codegen.export import export as export
    from pfsc_drake.control.compliance.impedance_parameters import (
        CoordinateImpedance as CoordinateImpedance,
    )
    from pfsc_drake.control.compliance.impedance_parameters import Profile as Profile
    from pfsc_drake.control.fixtures.guides import Guide as Guide
    from pfsc_drake.control.fixtures.parameters import Fixture as Fixture
    from pfsc_drake.control.law.reference import rest_to_rest as rest_to_rest
    from pfsc_drake.control.law.reference import straight_lines as straight_lines
    from pfsc_drake.control.law.timed_reference import StreamLimits as StreamLimits
    from pfsc_drake.control.obstacles.parameters import WatchParameters as WatchParameters
    from pfsc_drake.control.obstacles.shapes import Capsule as Capsule
    from pfsc_drake.control.obstacles.shapes import ObstacleShape as ObstacleShape
    from pfsc_drake.control.streams.messages import WaypointSender as WaypointSender
    from pfsc_drake.control.streams.parameters import StreamParameters as StreamParameters
    from pfsc_drake.following.follower import Follower as Follower
    from pfsc_drake.following.guidance import GuidanceOptions as GuidanceOptions
    from pfsc_drake.following.guidance import add_guidance as add_guidance
    from pfsc_drake.following.options.compliance import ComplianceParameters as ComplianceParameters
    from pfsc_drake.following.options.controller import ControllerParameters as ControllerParameters
    from pfsc_drake.following.options.controller import GainParameters as GainParameters
    from pfsc_drake.following.options.controller import LawGains as LawGains
    from pfsc_drake.following.options.follower import FaultParameters as FaultParameters
    from pfsc_drake.following.options.follower import FollowerOptions as FollowerOptions
    from pfsc_drake.following.options.follower import ObstacleOptions as ObstacleOptions
    from pfsc_drake.following.path_following import add_path_following as add_path_following
    from pfsc_drake.following.streaming import add_path_streaming as add_path_streaming
    from pfsc_drake.following.surface_following import (
        add_surface_following as add_surface_following,
    )
    from pfsc_drake.geometry import Path as Path
    from pfsc_drake.geometry import WaypointTable as WaypointTable
    from pfsc_drake.geometry import path_from_waypoints as path_from_waypoints
    from pfsc_drake.geometry.regions.shapes import HalfSpace as HalfSpace
    from pfsc_drake.geometry.regions.shapes import SphereRegion as SphereRegion
    from pfsc_drake.robot.models.actuators import add_actuators as add_actuators
    from pfsc_drake.robot.models.files import models_directory as models_directory
    from pfsc_drake.systems.fuse import fuse as fuse

__all__ = ["InputError", "__version__", *_DOOR]

__getattr__ = door(__name__, _DOOR)
