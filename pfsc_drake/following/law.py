"""The law of a controller, what it believes of the robot, and how it watches and stops it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pfsc_drake.control.law.decoupling import DecouplingInverse
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.linearization import (
    RELATIVE_DEGREE,
    ActuationOptions,
    linearize,
)
from pfsc_drake.control.law.loop_at_rest import RestPosture
from pfsc_drake.control.law.safe_stop import SafeState
from pfsc_drake.control.law.supervision import SupervisionParameters
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.errors import InputError
from pfsc_drake.following.gains import choose_poles, loop_gains
from pfsc_drake.following.options.controller import ControllerParameters
from pfsc_drake.following.options.follower import FaultParameters
from pfsc_drake.following.posture import make_posture
from pfsc_drake.robot.robot_model import RobotModel

# f_c [Nm or N] and f_v [Nm s/rad or N s/m], each (N,)
Coefficients = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Believed:
    """A robot as its controller knows it, and how well its motion is measured.

    Attributes:
        robot: The robot, N joints.
        friction: Coefficients f_c and f_v, if any are known.
        resolution: Of the measured positions, shape (N,) [rad or m], or one for all.
        velocity_delay: How old measured velocities are [s]; a difference quotient is that of
            mid-interval.
        filter_time: By how much measured velocities are smoothed besides [s].
    """

    robot: RobotModel
    friction: Coefficients | None = None
    resolution: np.ndarray | float = 0.0
    velocity_delay: float = 0.0
    filter_time: float = 0.0


# s; a start beside the path takes a drive to its limit for some hundredths
_SATURATION_TIME = 0.2


def safe_state(
    parameters: ControllerParameters, robot: RobotModel, faults: FaultParameters
) -> SafeState:
    """Return how a robot is stopped and held after a fault.

    Args:
        parameters: Of the controller.
        robot: The robot as it is believed.
        faults: What is a fault.
    """
    effort = robot.gather("effort_limit") * parameters.effort_scale
    damping = parameters.brake_damping * np.where(np.isfinite(effort), effort, 0.0)
    return SafeState(damping, faults.hold_bandwidth, faults.effort_share)


def supervision(law: str, faults: FaultParameters, believed: Believed) -> SupervisionParameters:
    """Return what is watched of a robot's joints.

    Args:
        law: Name of the law.
        faults: What is a fault.
        believed: The robot.
    """
    return SupervisionParameters(
        tolerance=faults.plausibility,
        resolution=np.broadcast_to(believed.resolution, believed.robot.dimension),
        filter_time=believed.filter_time,
        joint_limits=faults.joint_limits,
        saturation_time=_saturation_time(law, faults.saturation_time),
        chatter_turns=faults.chatter_turns,
        overspeed=faults.overspeed,
    )


def _saturation_time(law: str, given: float | None) -> float:
    """Return how long a drive may be at its limit [s]; 0 for ever."""
    if given is not None:
        return given
    return 0.0 if RELATIVE_DEGREE[law] == 1 else _SATURATION_TIME


def make_law(
    parameters: ControllerParameters,
    robot: RobotModel,
    manifold: Manifold,
    rest: Callable[[], RestPosture] | None = None,
    faults: FaultParameters | None = None,
) -> FollowingLaw:
    """Return the law that makes a robot follow a manifold.

    Args:
        parameters: What is chosen; poles that are to be chosen are filled in.
        robot: The robot.
        manifold: What to follow.
        rest: Tells where the robot starts at rest; needed to choose poles.
        faults: What happens after a fault.

    Raises:
        InputError: If the law does not suit the robot, or its gains are missing or wrong.
    """
    law = parameters.law
    damping = parameters.boundary_layer_damping
    options = ActuationOptions(parameters.sampling_time, np.array(damping) if damping else None)
    linearization = linearize(robot, law, manifold, options)
    if law not in parameters.gains:
        given = ", ".join(parameters.gains) or "none"
        poles = [-20.0] * RELATIVE_DEGREE[law]
        kinds = dict.fromkeys(coordinate.kind.value for coordinate in manifold.coordinates)
        example = ", ".join(f"{kind}: {{poles: {poles}}}" for kind in kinds)
        raise InputError(
            f"controller.gains: no gains for the law '{law}'; given are {given}; "
            f"write {law}: {{{example}}} with poles (1/s) of your choice"
        )
    by_kind = parameters.gains[law]
    choose_poles(parameters, robot, linearization, rest)
    gains = loop_gains(by_kind, law, linearization)
    relative_degree = linearization.relative_degree
    effort = robot.gather("effort_limit") * parameters.effort_scale
    limits = robot.gather("velocity_limit") if relative_degree == 1 else effort
    return FollowingLaw(
        robot,
        linearization,
        gains.outputs,
        DecouplingInverse(parameters.min_rcond, parameters.damped_below),
        limits,
        parameters.max_alpha,
        safe_state(parameters, robot, faults or FaultParameters()),
        tells_reference_velocity=parameters.friction.needs_reference_velocity,
        posture=make_posture(parameters.posture, robot, gains.posture, rest),
    )
