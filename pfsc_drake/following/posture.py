"""What the joints of a robot do that its task leaves free."""

from collections.abc import Callable

import numpy as np

from pfsc_drake.control.law.loop_at_rest import RestPosture
from pfsc_drake.control.law.posture import Posture, PostureCoordinate, range_weight
from pfsc_drake.control.law.stabilization import Stabilization
from pfsc_drake.errors import InputError
from pfsc_drake.following.options.posture import PostureParameters
from pfsc_drake.robot.robot_model import RobotModel, largest_speeds
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.swivel import swivel_angle, upward_direction

_KEY = "controller.posture"
# of the largest speed of a joint, what a posture may make of it together with the outputs
_SPEED_SHARE = 0.8


def make_posture(
    parameters: PostureParameters,
    robot: RobotModel,
    gains: Stabilization | None,
    rest: Callable[[], RestPosture] | None,
) -> Posture | None:
    """Return how joints beyond the number of outputs keep next to their reference.

    Args:
        parameters: What is chosen.
        robot: The robot as it is believed.
        gains: Of the joints, if there are more than outputs.
        rest: Tells where the robot starts at rest; needed to keep an elbow.

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
    return Posture(gains, _weight(parameters, robot), coordinate, speeds)


def _weight(parameters: PostureParameters, robot: RobotModel) -> np.ndarray | None:
    n, given = robot.dimension, parameters.joint_weights
    if given:
        if len(given) != n:
            raise InputError(f"{_KEY}.joint_weights: {len(given)} values; the robot has {n} joints")
        return np.array(given, dtype=float)
    return {"identity": np.ones(n), "range": range_weight(robot), "inertia": None}[
        parameters.weight
    ]


def _swivel(parameters: PostureParameters, robot: RobotModel, q: np.ndarray) -> PostureCoordinate:
    numbers = parameters.elbow_joints
    if not isinstance(robot, SerialChain) or max(numbers) > robot.dimension:
        raise InputError(
            f"{_KEY}.elbow_joints = {numbers}; the robot has {robot.dimension} joints one after "
            "the other"
        )
    shoulder, elbow, wrist = (number - 1 for number in numbers)
    joints = (shoulder, elbow, wrist)
    upward = upward_direction(robot, q, joints)
    return lambda jets: swivel_angle(robot, jets, joints, upward)
