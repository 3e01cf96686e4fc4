"""Hand guiding of a tool through space, outside of regions, in one call."""

import dataclasses as dc
import math
from collections.abc import Sequence

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake.checks import require_not_negative
from pfsc_drake.control.compliance.impedance_parameters import CoordinateImpedance, Profile
from pfsc_drake.control.fixtures.fixture_parameters import Fixture
from pfsc_drake.control.fixtures.guides import Guide
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.controller.fixtures import free_motion, make_command_dynamics
from pfsc_drake.controller.follower import Follower
from pfsc_drake.controller.options.compliance_parameters import ComplianceParameters
from pfsc_drake.controller.options.controller_parameters import ExternalTorqueParameters
from pfsc_drake.controller.options.follower_options import FixtureOptions, FollowerOptions
from pfsc_drake.controller.tasks.space_task import SpaceTask
from pfsc_drake.geometry import matrix_to_quaternion
from pfsc_drake.geometry.regions.moving import MovingRegion
from pfsc_drake.geometry.regions.region import Region
from pfsc_drake.geometry.regions.region_checks import refuse_forbidden_start, refuse_same_regions
from pfsc_drake.robot.robot_model import RobotModel, pose_function

# 1/s; with slower poles changes of the operator's force push the tool by tenths of a millimetre
_BANDWIDTH = 50.0
# of the free motion: kg, N s/m
_MASS, _DAMPING = 3.0, 60.0
# rad/s, of the operator's force for laws of elastic joints
_FORCE_BANDWIDTH = 200.0


def _light() -> ComplianceParameters:
    along = CoordinateImpedance(Profile(_MASS), Profile(_DAMPING), Profile(0.0))
    return ComplianceParameters(tangential=along)


@dc.dataclass
class GuidanceOptions(FollowerOptions):
    """Options of hand guiding; further attributes: :class:`FollowerOptions`.

    Attributes:
        compliance: ``tangential``: mass and damping for the operator; ``rotational``: compliance of
            the orientation with torques, if it complies.
        fixtures: Virtual fixtures, and limits of the robot.
        tells_law: Whether a law that commands torques compensates the operator's force, which would
            otherwise push the tool away from its reference; a source in
            ``controller.external_torque`` has priority.
        servo_lag: ``tau`` [s] of velocity servos, the inverse of their bandwidth.
        servo_delay: Delay of their commands [s], a multiple of the sampling time.
    """

    bandwidth: float = _BANDWIDTH
    compliance: ComplianceParameters = dc.field(default_factory=_light)
    fixtures: FixtureOptions = dc.field(default_factory=FixtureOptions)
    tells_law: bool = True
    servo_lag: float = 5e-3
    servo_delay: float = 0.0


def add_guidance(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    tool: str,
    regions: Sequence[Region | MovingRegion | Fixture] = (),
    law: str = "elastic",
    *,
    guides: Sequence[Guide] = (),
    start: RigidTransform | None = None,
    oriented: bool = True,
    options: GuidanceOptions | None = None,
) -> Follower:
    """Add a controller for hand guiding of a tool through space, outside of regions.

    ::

        ball = SphereRegion([1.0, 0.0, 0.8], 0.1, inside=False)
        follower = add_guidance(builder, plant, "tcp", [ball], law="rigid")
        builder.Connect(plant.get_state_output_port(), follower.GetInputPort("plant_state"))
        builder.Connect(sensor.get_output_port(), follower.GetInputPort("wrench"))
        builder.Connect(follower.GetOutputPort("actuation"), plant.get_actuation_input_port())

    Args:
        builder: Builder of the diagram.
        plant: The robot, finalized: its nominal model.
        tool: Name of the frame whose origin stays outside of the regions.
        regions: Regions for the tool point, each at rest or moving; hard, or as a
            :class:`~pfsc_drake.Fixture` with a stiffness.
        law: Name of the law.
        guides: Paths that attract the tool, see :class:`~pfsc_drake.Guide`: it follows the one
            to which the operator guides it, until the operator pulls it away.
        start: Pose of the tool at the start, in the world; by ``options.posture`` if omitted.
        oriented: Whether its orientation is constant; False for robots of fewer than six joints.
        options: Further options.

    Returns:
        The controller, one diagram with the ports of :class:`Follower`.

    Raises:
        InputError: If robot, regions, law and options do not go together, the start is out of
            reach or in a region.
    """
    chosen = _with_force(options or GuidanceOptions(), law)
    period = chosen.controller.sampling_time
    motion = free_motion(chosen.compliance, period)
    for key in ("servo_lag", "servo_delay"):
        require_not_negative(key, getattr(chosen, key))
    fixtures = [region if isinstance(region, Fixture) else Fixture(region) for region in regions]

    def task(robot: RobotModel, near: np.ndarray, relative_degree: int) -> SpaceTask:
        y_t, R_e = _pose(robot, start, near)
        _check_start(fixtures, y_t)
        quaternion = matrix_to_quaternion(R_e) if oriented else None
        lead = make_command_dynamics(
            relative_degree,
            chosen.fixtures,
            period,
            lag=chosen.servo_lag,
            delay=chosen.servo_delay,
        )
        manifold = SpaceManifold(relative_degree, quaternion)
        named = {f"guides[{number}]": guide for number, guide in enumerate(guides)}
        return SpaceTask(manifold, y_t, fixtures, motion, lead, chosen.fixtures, named)

    follower = Follower(plant, tool, law, task, chosen)
    builder.AddSystem(follower)
    return follower


def _with_force(options: GuidanceOptions, law: str) -> GuidanceOptions:
    """Return the options, with the operator's force as input of the law if it uses it."""
    degree, controller = RELATIVE_DEGREE.get(law, 1), options.controller
    if degree == 1 or not options.tells_law or controller.external_torque.source != "none":
        return options
    bandwidth = controller.external_torque.bandwidth
    if degree > 2:  # rigid joints need no derivatives
        bandwidth = bandwidth or _FORCE_BANDWIDTH
    torque = ExternalTorqueParameters("measured", bandwidth)
    return dc.replace(options, controller=dc.replace(controller, external_torque=torque))


def _pose(
    robot: RobotModel, start: RigidTransform | None, posture: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pose of the tool at the start, position [m] and orientation."""
    if start is not None:
        return start.translation(), start.rotation().matrix()
    pose = pose_function(robot)(posture).full().ravel()
    return pose[:3], pose[3:].reshape(3, 3)


def _check_start(fixtures: Sequence[Fixture], y_t: np.ndarray) -> None:
    """Refuse duplicate regions, and a start in a hard one."""
    names = {f"regions[{number}]": fixture for number, fixture in enumerate(fixtures)}
    refuse_same_regions({name: fixture.region for name, fixture in names.items()}, y_t)
    hard = {name: f.region for name, f in names.items() if f.stiffness == math.inf}
    refuse_forbidden_start(hard, y_t)
