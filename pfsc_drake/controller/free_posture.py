"""Null-space motion of redundant joints: posture and its reference."""

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.control.compliance.posture_impedance import (
    CompliantPosture,
    NullSpaceImpedance,
    NullSpaceImpedanceParameters,
)
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.loop_at_rest import RestPosture
from pfsc_drake.control.law.posture import Posture, PostureCoordinate, range_weight
from pfsc_drake.control.law.stabilization import Stabilization
from pfsc_drake.controller.options.controller_parameters import (
    ControllerParameters,
    PostureParameters,
)
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel, largest_speeds
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.swivel import swivel_angle, upward_direction
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.following_controller import FollowingController
from pfsc_drake.yaml.fields import spread

_KEY = "controller.posture"
# share of the largest speed of a joint for the posture and the outputs together
_SPEED_SHARE = 0.8
# margin to the ends of joints [rad or m]
_END_MARGIN = 0.02


def make_posture(
    parameters: PostureParameters,
    robot: RobotModel,
    gains: Stabilization | None,
    rest: Callable[[], RestPosture] | None,
) -> Posture | None:
    """Return the posture control of redundant joints, if there are any.

    Args:
        parameters: Parameters of the posture.
        robot: Nominal model of the robot.
        gains: Gains of the joints, if they are redundant.
        rest: Returns the rest posture at the start; needed for the task ``elbow``.

    Raises:
        InputError: If the parameters do not suit the robot.
    """
    if gains is None:
        return None
    coordinate = None
    if parameters.task == "elbow":
        if rest is None:
            raise InputError(f"{_KEY}.task = elbow needs a start of the robot")
        coordinate = _swivel(parameters, robot, rest().q_J)
    speeds = _SPEED_SHARE * largest_speeds(robot)
    low, high = robot.gather("position_limits").T
    ends = np.array([low + _END_MARGIN, high - _END_MARGIN])
    return Posture(gains, _weight(parameters, robot), coordinate, speeds, ends)


def _weight(parameters: PostureParameters, robot: RobotModel) -> np.ndarray | None:
    n = robot.dimension
    values = spread(parameters.joint_weights, n)
    if values:
        if len(values) != n:
            raise InputError(
                f"{_KEY}.joint_weights = {list(values)}; allowed: {n} values, one per joint"
            )
        return np.array(values, dtype=float)
    return {"identity": np.ones(n), "range": range_weight(robot), "inertia": None}[
        parameters.weight
    ]


def _swivel(parameters: PostureParameters, robot: RobotModel, q: np.ndarray) -> PostureCoordinate:
    numbers = parameters.elbow_joints
    if not isinstance(robot, SerialChain) or max(numbers) > robot.dimension:
        raise InputError(
            f"{_KEY}.elbow_joints = {numbers}; the robot has {robot.dimension} joints in series"
        )
    shoulder, elbow, wrist = (number - 1 for number in numbers)
    joints = (shoulder, elbow, wrist)
    upward = upward_direction(robot, q, joints)
    return lambda jets: swivel_angle(robot, jets, joints, upward)


def add_posture_reference(
    builder: DiagramBuilder,
    robot: RobotModel,
    options: ControllerParameters,
    law: FollowingLaw,
    controller: FollowingController,
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Add the posture reference of a redundant robot.

    Args:
        builder: Builder of the diagram.
        robot: Nominal model of the robot.
        options: Parameters of the controller.
        law: The law.
        controller: System of the law.
        ports: ``joint_state``, ``manifold_point``, and ``posture_torque`` if it complies.

    Returns:
        ``posture_reference``, derivatives 0..r by rows, shape ((r + 1) N,), if there is one.

    Raises:
        InputError: If the posture does not suit the robot.
    """
    if law.posture is None:
        return {}
    parameters, manifold = options.posture, law.linearization.manifold
    impedance = NullSpaceImpedance(
        NullSpaceImpedanceParameters(
            parameters.inertia,
            parameters.damping,
            0.0 if parameters.is_pulled else parameters.stiffness,
            parameters.filter_rate,
        ),
        law.linearization.relative_degree,
        controller.period,
    )
    pulled = (parameters.task, parameters.stiffness) if parameters.is_pulled else ("", 0.0)
    block = CompliantPosture(
        robot, manifold, law.posture, impedance, *pulled, _goal(parameters, robot)
    )
    posture = builder.AddNamedSystem("posture_reference", BlockSystem(block, controller.period))
    for name in ("joint_state", "manifold_point"):
        builder.Connect(ports[name], posture.GetInputPort(name))
    if "posture_torque" in ports:
        builder.Connect(ports["posture_torque"], posture.GetInputPort("tau_ext"))
    reference = posture.GetOutputPort("posture_reference")
    builder.Connect(reference, controller.GetInputPort("posture_reference"))
    return {"posture_reference": reference}


def _goal(parameters: PostureParameters, robot: RobotModel) -> np.ndarray | None:
    """Return the goal of the posture, shape (N,) [rad or m], or None for its start."""
    values, key = spread(parameters.reference_deg, robot.dimension), f"{_KEY}.reference_deg"
    if not values:
        return None
    if len(values) != robot.dimension:
        allowed = f"{robot.dimension} values, one per joint"
        raise InputError(f"{key} = {list(values)}; allowed: {allowed}")
    goal = np.where(robot.gather("is_revolute"), np.deg2rad(values), values)
    lower, upper = robot.gather("position_limits").T
    for value, q, low, high, name in zip(values, goal, lower, upper, robot.names, strict=True):
        if not low <= q <= high:
            turns = robot.gather("is_revolute")[robot.names.index(name)]
            ends = np.rad2deg([low, high]) if turns else np.array([low, high])
            raise InputError(
                f"{key}: {value:g} of {name}; its limits are {ends[0]:.4g} to {ends[1]:.4g} "
                f"{'deg' if turns else 'm'}"
            )
    return goal


def warn_unused(parameters: ControllerParameters, law: FollowingLaw) -> list[str]:
    """Return warnings of posture parameters without effect, one sentence each.

    Args:
        parameters: Parameters of the controller.
        law: The law.
    """
    if law.posture is not None or parameters.posture == PostureParameters():
        return []
    m = law.linearization.num_outputs
    return [
        f"{_KEY} is not used: the task's {m} outputs leave none of the {m} joints free; "
        "path.orientation.task: tool_axis, yaw or none would"
    ]
