"""The law of a controller."""

from collections.abc import Callable

import numpy as np

from pfsc_drake.control.law.decoupling import DecouplingInverse
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.linearization import (
    RELATIVE_DEGREE,
    ActuationOptions,
    linearize,
)
from pfsc_drake.control.law.loop_at_rest import RestPosture
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.errors import InputError
from pfsc_drake.following.gains import choose_poles, loop_gains
from pfsc_drake.following.options.controller import ControllerParameters
from pfsc_drake.following.options.faults import FaultParameters
from pfsc_drake.following.posture import make_posture
from pfsc_drake.following.safety import safe_state
from pfsc_drake.robot.robot_model import RobotModel


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
