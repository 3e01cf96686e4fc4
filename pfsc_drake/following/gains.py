"""Gains of a law: those given, and poles that are chosen for what they have to bear."""

import dataclasses as dc
from collections.abc import Callable

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.linearization import Linearization
from pfsc_drake.control.law.loop_at_rest import LoopAtRest, RestPosture
from pfsc_drake.control.law.posture import Posture
from pfsc_drake.control.law.robust_gains import SampledRobot, choose_fast_pole, rule_of_poles
from pfsc_drake.control.law.stabilization import (
    CoordinateGains,
    LoopGains,
    Stabilization,
    check_gains,
    gains_from_poles,
)
from pfsc_drake.errors import InputError
from pfsc_drake.following.options.controller import (
    ControllerParameters,
    GainParameters,
    LawGains,
)
from pfsc_drake.following.posture import make_posture
from pfsc_drake.robot.robot_model import RobotModel

_DIGITS = 3


def gains_of(
    parameters: GainParameters, relative_degree: int, law: str, name: str
) -> CoordinateGains:
    """Return the gains of one kind of coordinate.

    Args:
        parameters: What is chosen.
        relative_degree: ``r`` of the law.
        law: Name of the law.
        name: Of the kind, for messages.

    Raises:
        InputError: If there are more or fewer than r, or they do not make the error vanish.
    """
    key = f"controller.gains.{law}.{name}"
    needed = relative_degree - parameters.free
    if parameters.free and not needed:
        raise InputError(
            f"{key}.free = true with the law '{law}', whose servos hold every joint; must be false"
        )
    if parameters.poles:
        gains = gains_from_poles(parameters.poles, parameters.integral_pole)
    elif len(parameters.coefficients) == needed:
        gains = CoordinateGains(tuple(parameters.coefficients), parameters.integral)
    else:
        otherwise = "" if parameters.free else ", or poles: auto with a bandwidth (1/s)"
        raise InputError(
            f"{key}: {len(parameters.coefficients)} coefficients and no poles; "
            f"the law needs {needed} of either{otherwise}"
        )
    if parameters.free:
        gains = CoordinateGains((0.0, *gains.proportional), is_free=True)
    check_gains(gains, relative_degree, key)
    return gains


def loop_gains(by_kind: LawGains, law: str, linearization: Linearization) -> LoopGains:
    """Return all gains of a law; coordinates of a kind share theirs.

    Args:
        by_kind: What is chosen.
        law: Name of the law.
        linearization: The law.

    Raises:
        InputError: See :func:`gains_of`; or a coordinate is free that follows a moving point.
    """
    r = linearization.relative_degree
    names = [coordinate.kind.value for coordinate in linearization.manifold.coordinates]
    free = [kind for kind in dict.fromkeys(names) if getattr(by_kind, kind).free]
    if free and linearization.manifold.follows_time:
        raise InputError(
            f"controller.gains.{law}.{free[0]}.free = true: must be false with controller.manifold "
            "= trajectory, whose reference is a point that moves"
        )
    outputs = Stabilization([gains_of(getattr(by_kind, k), r, law, k) for k in names], r, names)
    if not linearization.is_redundant:
        return LoopGains(outputs)
    joint = _joint_gains(by_kind, r, law)
    return LoopGains(
        outputs,
        Stabilization(
            [joint] * linearization.num_joints, r, ["posture"] * linearization.num_joints
        ),
    )


def _joint_gains(by_kind: LawGains, relative_degree: int, law: str) -> CoordinateGains:
    """Return the gains of joints next to a posture, by default those of ``xi``."""
    if by_kind.posture.is_given:
        return gains_of(by_kind.posture, relative_degree, law, "posture")
    # an integral part would fight what the outputs keep the joints from
    if by_kind.xi.poles:
        return gains_from_poles(by_kind.xi.poles)
    gains = CoordinateGains(tuple(by_kind.xi.coefficients))
    check_gains(gains, relative_degree, f"controller.gains.{law}.posture, by default xi's")
    return gains


@once_per_content()
def sampled_robot(
    parameters: ControllerParameters,
    robot: RobotModel,
    linearization: Linearization,
    rest: RestPosture,
    posture: Posture | None = None,
) -> SampledRobot:
    """Return a law on its robot at rest.

    Args:
        parameters: What is chosen.
        robot: The robot.
        linearization: The law, which commands torques.
        rest: Where the robot rests.
        posture: What joints beyond the number of outputs do, if there are any.
    """
    period = parameters.sampling_time
    loop = LoopAtRest(robot, linearization, rest, period, posture)
    return SampledRobot(loop, period, not robot.is_rigid)


def choose_poles(
    parameters: ControllerParameters,
    robot: RobotModel,
    linearization: Linearization,
    rest: Callable[[], RestPosture] | None,
) -> None:
    """Fill in the poles that are left open, by the rule of the fast pair.

    Args:
        parameters: What is chosen; changed.
        robot: The robot.
        linearization: The law.
        rest: Tells where the robot starts at rest.

    Raises:
        InputError: If other gains of the law are missing or wrong.
    """
    law, r = parameters.law, linearization.relative_degree
    by_kind = parameters.gains[law]
    kinds = dict.fromkeys(c.kind.value for c in linearization.manifold.coordinates)
    if linearization.is_redundant:
        kinds["posture"] = None
    given = {kind: getattr(by_kind, kind) for kind in kinds}
    automatic = {kind: gains for kind, gains in given.items() if gains.is_automatic}
    if not automatic:
        return
    fast = 0.0
    if r > 2:  # else the rule knows no fast ones
        if rest is None:
            raise InputError(f"controller.gains.{law}: poles: auto needs a start of the robot")

        def tried(fast: float) -> LoopGains:
            chosen = {
                kind: dc.replace(gains, poles=rule_of_poles(gains.bandwidth, fast, r))
                for kind, gains in automatic.items()
            }
            return loop_gains(dc.replace(by_kind, **chosen), law, linearization)

        posture = make_posture(parameters.posture, robot, tried(1.0).posture, rest)
        fast = choose_fast_pole(
            sampled_robot(parameters, robot, linearization, rest(), posture),
            tried,
            [gains.bandwidth for gains in automatic.values()],
            max(gains.bears for gains in automatic.values()),
        )
    for gains in automatic.values():
        poles = rule_of_poles(gains.bandwidth, fast, r)
        gains.poles = [float(f"{pole:.{_DIGITS}g}") for pole in poles]
