"""Gains of a scenario: those given, and poles that are chosen for what they have to bear."""

from collections.abc import Callable

from diagrams.scenario import ControllerParameters, GainParameters
from pfsc_drake.control.law.linearization import Linearization
from pfsc_drake.control.law.loop_at_rest import LoopAtRest, RestPosture
from pfsc_drake.control.law.robust_gains import SampledRobot, choose_fast_pole, rule_of_poles
from pfsc_drake.control.law.stabilization import (
    CoordinateGains,
    Stabilization,
    check_gains,
    gains_from_poles,
)
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel

_DIGITS = 3


def gains_of(
    parameters: GainParameters, relative_degree: int, law: str, name: str
) -> CoordinateGains:
    """Return the gains of one kind of coordinate.

    Args:
        parameters: What the scenario says.
        relative_degree: ``r`` of the law.
        law: Name of the law.
        name: Of the kind, for messages.

    Raises:
        InputError: If there are more or fewer than r, or they do not make the error vanish.
    """
    key = f"controller.gains.{law}.{name}"
    if parameters.poles:
        gains = gains_from_poles(parameters.poles, parameters.integral_pole)
    elif len(parameters.coefficients) == relative_degree:
        gains = CoordinateGains(tuple(parameters.coefficients), parameters.integral)
    else:
        raise InputError(
            f"{key}: {len(parameters.coefficients)} coefficients and no poles; "
            f"the law needs {relative_degree} of either, or poles: auto with a bandwidth (1/s)"
        )
    check_gains(gains, relative_degree, key)
    return gains


def sampled_robot(
    parameters: ControllerParameters,
    robot: RobotModel,
    linearization: Linearization,
    rest: RestPosture,
) -> SampledRobot:
    """Return a law on its robot at rest.

    Args:
        parameters: What the scenario says.
        robot: The robot.
        linearization: The law, which commands torques.
        rest: Where the robot rests.
    """
    period = parameters.sampling_time
    loop = LoopAtRest(robot, linearization, rest, period)
    return SampledRobot(loop, period, not robot.is_rigid)


def choose_poles(
    parameters: ControllerParameters,
    robot: RobotModel,
    linearization: Linearization,
    rest: Callable[[], RestPosture] | None,
) -> None:
    """Fill in the poles that a scenario leaves open, by the rule of the fast pair.

    Args:
        parameters: What the scenario says; changed.
        robot: The robot.
        linearization: The law.
        rest: Tells where the robot starts at rest.

    Raises:
        InputError: If other gains of the law are missing or wrong.
    """
    law, r = parameters.law, linearization.relative_degree
    kinds = [c.kind.value for c in linearization.manifold.coordinates]
    by_kind = {kind: getattr(parameters.gains[law], kind) for kind in dict.fromkeys(kinds)}
    automatic = {kind: gains for kind, gains in by_kind.items() if gains.is_automatic}
    if not automatic:
        return
    fast = 0.0
    if r > 2:  # else the rule knows no fast ones
        if rest is None:
            raise InputError(f"controller.gains.{law}: poles: auto needs a start of the robot")

        def gains(fast: float) -> Stabilization:
            poles = {
                kind: gains_from_poles(rule_of_poles(given.bandwidth, fast, r))
                if kind in automatic
                else gains_of(given, r, law, kind)
                for kind, given in by_kind.items()
            }
            return Stabilization([poles[kind] for kind in kinds], r, kinds)

        fast = choose_fast_pole(
            sampled_robot(parameters, robot, linearization, rest()),
            gains,
            [given.bandwidth for given in automatic.values()],
            max(given.bears for given in automatic.values()),
        )
    for given in automatic.values():
        poles = rule_of_poles(given.bandwidth, fast, r)
        given.poles = [float(f"{pole:.{_DIGITS}g}") for pole in poles]
