"""Law of a controller: gains, nominal model, supervision, and stop of the robot."""

import dataclasses as dc
from collections.abc import Callable

import numpy as np

from pfsc_drake.checks import require, require_whole_ticks
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.estimation.robot_state import MOST_TICKS
from pfsc_drake.control.law.decoupling import DecouplingInverse
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.laws import RELATIVE_DEGREE, ActuationOptions
from pfsc_drake.control.law.linearization import Linearization, linearize
from pfsc_drake.control.law.loop_at_rest import LoopAtRest, RestPosture
from pfsc_drake.control.law.posture import Posture
from pfsc_drake.control.law.robust_gains import SampledRobot, choose_fast_pole, rule_of_poles
from pfsc_drake.control.law.safe_stop import SafeState
from pfsc_drake.control.law.stabilization import (
    CoordinateGains,
    LoopGains,
    Stabilization,
    check_gains,
    gains_from_poles,
)
from pfsc_drake.control.law.supervision import SupervisionParameters
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.controller.free_posture import make_posture
from pfsc_drake.controller.nominal_robot import NominalRobot
from pfsc_drake.controller.options.controller_parameters import (
    ControllerParameters,
    GainParameters,
    LawGains,
)
from pfsc_drake.controller.options.follower_options import FaultParameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.yaml.fields import spread

_DIGITS = 3


def ticks_of(options: ControllerParameters) -> int:
    """Return the nominal delay of the torques in sampling intervals.

    Args:
        options: Parameters of the controller.

    Raises:
        InputError: If the delay is not a multiple of the sampling time, or too long.
    """
    return require_whole_ticks(
        "controller.delay", options.delay or 0.0, options.sampling_time, MOST_TICKS
    )


def gains_of(
    parameters: GainParameters, relative_degree: int, law: str, name: str
) -> CoordinateGains:
    """Return the gains of one kind of coordinate.

    Args:
        parameters: Parameters of the gains.
        relative_degree: ``r`` of the law.
        law: Name of the law.
        name: Name of the kind, for messages.

    Raises:
        InputError: If there are more or fewer than r, or the error dynamics are not stable.
    """
    key = f"controller.gains.{law}.{name}"
    needed = relative_degree - parameters.free
    if parameters.free and not needed:
        raise InputError(
            f"{key}.free = true with the law '{law}', whose servos hold every joint; must be false"
        )
    if parameters.poles:
        _check_poles(parameters.poles, needed, f"{key}.poles", law)
        gains = gains_from_poles(spread(parameters.poles, needed), parameters.integral_pole)
    elif len(parameters.coefficients) == needed:
        gains = CoordinateGains(tuple(parameters.coefficients), parameters.integral)
        _check_coefficients(gains, key)
    else:
        otherwise = "" if parameters.free else ", or poles: auto with a bandwidth (1/s)"
        coefficients = parameters.coefficients
        found = (
            f".coefficients = {coefficients}"
            if coefficients
            else ": neither poles nor coefficients"
        )
        raise InputError(
            f"{key}{found}; allowed: {needed} poles (1/s) or "
            f"{needed} coefficients with the law '{law}'{otherwise}"
        )
    if parameters.free:
        gains = CoordinateGains((0.0, *gains.proportional), is_free=True)
    check_gains(gains, relative_degree, key)
    return gains


def _check_poles(poles: list[float], needed: int, key: str, law: str) -> None:
    """Refuse poles of the wrong number, and poles that are not stable."""
    count = "1 negative number" if needed == 1 else f"{needed} negative numbers"
    good = len(spread(poles, needed)) == needed and max(poles) < 0.0
    several = ", or one for all" if needed > 1 else ""
    require(good, key, poles, f"{count} (1/s) with the law '{law}'{several}")


def _check_coefficients(gains: CoordinateGains, key: str) -> None:
    """Refuse coefficients of a polynomial that is not Hurwitz."""
    if not np.all(np.isfinite(gains.polynomial)):
        return  # check_gains reports it
    pole, integral = gains.rightmost_pole, gains.integral
    if pole.real >= 0.0:
        also = f" with integral = {integral:g}" if integral else ""
        root = f"{pole.real:.4g}{f'{pole.imag:+.4g}j' if pole.imag else ''}"
        raise InputError(
            f"{key}.coefficients = {list(gains.proportional)}{also}: not Hurwitz, pole at {root} "
            "1/s; allowed: coefficients of a polynomial whose roots have negative real parts"
        )


def loop_gains(by_kind: LawGains, law: str, linearization: Linearization) -> LoopGains:
    """Return all gains of a law; coordinates of a kind share them.

    Args:
        by_kind: Gains by kind of coordinate.
        law: Name of the law.
        linearization: The law.

    Raises:
        InputError: If gains do not fit the law, or a coordinate of a tracked trajectory is free.
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
    """Return the gains of the joints about their posture, by default those of ``xi``."""
    if by_kind.posture.is_given:
        return gains_of(by_kind.posture, relative_degree, law, "posture")
    # an integral part would act against the outputs
    if by_kind.xi.poles:
        return gains_from_poles(spread(by_kind.xi.poles, relative_degree))
    gains = CoordinateGains(tuple(by_kind.xi.coefficients))
    check_gains(gains, relative_degree, f"controller.gains.{law}.posture, by default of xi")
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
        parameters: Parameters of the controller.
        robot: The robot.
        linearization: The law, which commands torques.
        rest: Rest posture of the robot.
        posture: Posture control of redundant joints, if there are any.
    """
    period = parameters.sampling_time
    loop = LoopAtRest(robot, linearization, rest, period, posture, ticks_of(parameters))
    return SampledRobot(loop, period, not robot.is_rigid)


def choose_poles(
    parameters: ControllerParameters,
    robot: RobotModel,
    linearization: Linearization,
    rest: Callable[[], RestPosture] | None,
) -> None:
    """Fill in automatic poles, by the rule of the fast pair.

    Args:
        parameters: Parameters of the controller; changed.
        robot: The robot.
        linearization: The law.
        rest: Returns the rest posture at the start.

    Raises:
        InputError: If other gains of the law are missing or wrong.
    """
    law, r = parameters.law, linearization.relative_degree
    by_kind = parameters.gains[law]
    kinds = dict.fromkeys(c.kind.value for c in linearization.manifold.coordinates)
    if linearization.is_redundant:
        kinds["posture"] = None
    all_gains = {kind: getattr(by_kind, kind) for kind in kinds}
    automatic = {kind: gains for kind, gains in all_gains.items() if gains.is_automatic}
    if not automatic:
        return
    fast = 0.0
    if r > 2:  # else the rule knows no fast ones
        if rest is None:
            raise InputError(f"controller.gains.{law}: poles: auto needs a start of the robot")

        def tried(fast: float) -> LoopGains:
            # an integral part is slower than the requested bandwidth
            chosen = {
                kind: dc.replace(
                    gains, poles=rule_of_poles(gains.bandwidth, fast, r), integral_pole=0.0
                )
                for kind, gains in automatic.items()
            }
            return loop_gains(dc.replace(by_kind, **chosen), law, linearization)

        posture = make_posture(parameters.posture, robot, tried(1.0).posture, rest)
        fast = choose_fast_pole(
            sampled_robot(parameters, robot, linearization, rest(), posture),
            tried,
            [gains.bandwidth for gains in automatic.values()],
            max(gains.tolerated_error for gains in automatic.values()),
        )
    for gains in automatic.values():
        poles = rule_of_poles(gains.bandwidth, fast, r)
        gains.poles = [float(f"{pole:.{_DIGITS}g}") for pole in poles]


# s; a start beside the path takes a drive to its limit for some hundredths
_SATURATION_TIME = 0.2


def safe_state(
    parameters: ControllerParameters, robot: RobotModel, faults: FaultParameters
) -> SafeState:
    """Return the parameters of stop and hold after a fault.

    Args:
        parameters: Parameters of the controller.
        robot: Nominal model of the robot.
        faults: Parameters of faults.
    """
    effort = robot.gather("effort_limit") * parameters.effort_scale
    damping = parameters.brake_damping * np.where(np.isfinite(effort), effort, 0.0)
    has_brakes = faults.brakes is not None
    return SafeState(damping, faults.hold_bandwidth, faults.effort_share, has_brakes)


def supervision(law: str, faults: FaultParameters, nominal: NominalRobot) -> SupervisionParameters:
    """Return the parameters of the supervision of a robot's joints.

    Args:
        law: Name of the law.
        faults: Parameters of faults.
        nominal: Nominal model of the robot.
    """
    return SupervisionParameters(
        tolerance=faults.plausibility,
        resolution=np.broadcast_to(nominal.resolution, nominal.robot.dimension),
        filter_time=nominal.filter_time,
        joint_limits=faults.joint_limits,
        saturation_time=_saturation_time(law, faults.saturation_time),
        chatter_turns=faults.chatter_turns,
        overspeed=faults.overspeed,
    )


def _saturation_time(law: str, parameter: float | None) -> float:
    """Return the allowed time of a drive at its limit [s]; 0 for no limit."""
    if parameter is not None:
        return parameter
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
        parameters: Parameters of the controller; automatic poles are filled in.
        robot: The robot.
        manifold: Manifold to follow.
        rest: Returns the rest posture at the start; needed to choose poles.
        faults: Parameters of faults.

    Raises:
        InputError: If the law does not suit the robot, or its gains are missing or wrong.
    """
    law = parameters.law
    damping = spread(parameters.boundary_layer_damping, robot.dimension)
    options = ActuationOptions(
        parameters.sampling_time,
        np.array(damping) if damping else None,
        parameters.torque_lead,
    )
    linearization = linearize(robot, law, manifold, options)
    if law not in parameters.gains:
        present = ", ".join(parameters.gains) or "none"
        poles = [-20.0] * RELATIVE_DEGREE[law]
        kinds = dict.fromkeys(coordinate.kind.value for coordinate in manifold.coordinates)
        example = ", ".join(f"{kind}: {{poles: {poles}}}" for kind in kinds)
        raise InputError(
            f"controller.gains: no gains for the law '{law}'; given are {present}; "
            f"write {law}: {{{example}}} with poles (1/s) of your choice"
        )
    by_kind = parameters.gains[law]
    choose_poles(parameters, robot, linearization, rest)
    gains = loop_gains(by_kind, law, linearization)
    relative_degree = linearization.relative_degree
    effort = robot.gather("effort_limit") * parameters.effort_scale
    limits = robot.gather("velocity_limit") if relative_degree == 1 else effort
    for key in ("max_alpha", "min_rcond"):
        share = getattr(parameters, key)
        require(0.0 < share < 1.0, f"controller.{key}", share, "above 0, below 1")
    return FollowingLaw(
        robot,
        linearization,
        gains.outputs,
        DecouplingInverse(parameters.min_rcond, parameters.damped_below),
        limits,
        parameters.max_alpha,
        safe_state(parameters, robot, faults or FaultParameters()),
        has_reference_velocity=parameters.friction.needs_reference_velocity,
        posture=make_posture(parameters.posture, robot, gains.posture, rest),
        max_beyond_end=parameters.max_beyond_end,
    )
