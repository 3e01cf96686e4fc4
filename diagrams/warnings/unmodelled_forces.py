"""Unmodelled forces: forces that a law does not receive, and the deflection of the tool by them."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from diagrams.scenario import ComplianceParameters, ControllerParameters, ForcePulse
from diagrams.scenario.virtual_fixtures import FixtureParameters
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.laws import LAWS
from pfsc_drake.control.law.linearization import Linearization, decoupling_function
from pfsc_drake.control.law.loop_at_rest import LoopAtRest, RestPosture
from pfsc_drake.control.law.robust_gains import RobotError, SampledRobot
from pfsc_drake.control.law.stabilization import LoopGains
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import indices
from pfsc_drake.physics.hand_model import HandParameters
from pfsc_drake.physics.operator_hand import LiveHandParameters
from pfsc_drake.robot.robot_model import RobotModel, tool_motion_function

# s, duration of the simulated force, and number of evaluated instants
_LASTING, _INSTANTS = 3.0, 3000
_TOOL_VELOCITY = slice(12, 15)


def largest_deflection(
    robot: RobotModel,
    linearization: Linearization,
    gains: LoopGains,
    loop: LoopAtRest,
    rest: RestPosture,
    period: float,
) -> float:
    """Return the largest deflection of a tool at rest per newton of an unmodelled force [m/N].

    The force is a step of 3 s in the direction of the largest deflection. The deflection is
    transversal to a path or a surface, in space the whole displacement. For a rigid robot it tends
    to ``1 / (m a_1)``, with ``1/m`` the largest eigenvalue of ``J (D_E + D_M)^-1 J'`` and
    ``a_1 = p^2`` of a double pole. Laws for elastic joints interpret the force as motion of the
    links, and the deflection tends to ``J (a_3 - D_E^-1 K) D_E^-1 J' / a_1``, where K is ``K_d``
    (r = 3) or ``K_s`` (r = 4). An integral part removes it again; the maximum counts. Friction,
    which reduces it, is neglected.

    Args:
        robot: Nominal model of the robot.
        linearization: The law, which commands torques.
        gains: Gains of all coordinates, and of the posture if there is one.
        loop: The law on the robot at rest.
        rest: The posture at rest.
        period: Sampling time [s].
    """
    motion, n = tool_motion_function(robot), robot.dimension
    J = np.hstack([np.array(motion(rest.q_J, along))[_TOOL_VELOCITY] for along in np.eye(n)])
    slopes = np.array(decoupling_function(robot, linearization.manifold)(rest.q_J, rest.point))
    across = slopes[indices(linearization.manifold.coordinates, Kind.TRANSVERSAL)]
    A, B, C = loop.disturbance_response(gains)
    size, stride = len(A), math.ceil(_LASTING / (_INSTANTS * period))
    step = np.block([[A, B @ J.T], [np.zeros((3, size)), np.eye(3)]])
    step = np.linalg.matrix_power(step, stride)
    slopes, state, farthest = (across if len(across) else J) @ C, np.zeros((size, 3)), 0.0
    for _ in range(math.ceil(_LASTING / (stride * period))):
        state = step[:size, :size] @ state + step[:size, size:]
        farthest = max(farthest, float(np.linalg.norm(slopes @ state, 2)))
    return farthest


_DEFLECTIONS = "it takes them for deflections of the joints and may leave the path"
# m, transversal to a path or a surface without compliance
_LARGEST_DEFLECTION = 1e-3


@dataclass(frozen=True)
class ExpectedForces:
    """External forces that a scenario specifies.

    Attributes:
        tool: Largest force on the tool, without a wrench that only slows it down [N].
        on_links: Whether there are forces on links.
        holds_back: Whether there is a wrench that slows the tool down.
    """

    tool: float
    on_links: bool
    holds_back: bool


def unmodelled_forces(
    forces: ExpectedForces,
    tolerable: float,
    parameters: ControllerParameters,
    robot: RobotModel,
    law: FollowingLaw,
    rest: RestPosture,
    sampled: Callable[[], SampledRobot],
) -> list[str]:
    """Return warnings about forces that a law does not receive, one sentence each.

    Velocity servos reject them, and an observer of disturbances takes them for friction.

    Args:
        forces: The external forces.
        tolerable: Deflection of the tool without a warning [m], see :func:`tolerable_deflection`.
        parameters: The controller.
        robot: Nominal model of the robot.
        law: Its law.
        rest: The start, and the manifold's point there.
        sampled: Function that returns a law of torques on its robot at rest.
    """
    force, source = forces.tool, parameters.external_torque.source
    exact = _is_exact(parameters.law, robot)
    if exact and forces.on_links and source in ("none", "measured"):
        # the sensor in the flange does not measure forces on links
        return [_sentence("links", parameters.law, _DEFLECTIONS, _advice("'observed'"))]
    friction = parameters.friction
    observed = friction.source == "observer" and friction.observer == "disturbance"
    if source != "none" or (observed and not exact) or law.linearization.relative_degree == 1:
        return []
    if tolerable == np.inf and not exact:
        return []
    deflection = force * _deflection(sampled(), robot, law, rest) if force else 0.0
    if not deflection > tolerable and not (exact and (force or forces.holds_back)):
        return []
    effect = _DEFLECTIONS if exact else "they deflect it like a spring"
    if deflection > 0.0:
        effect += f", a step of {force:g} N by up to {1e3 * deflection:.2g} mm"
    if parameters.manifold == "space" and deflection > tolerable:
        effect += f", also into hard regions (fixtures.bound = {1e3 * tolerable:g} mm)"
    advice = _advice("'measured', 'observed'")
    if law.stabilization.is_free.any():  # with a measured force the law would resist the hand
        advice = "choose faster poles or an integral part across"
    return [_sentence("the tool", parameters.law, effect, advice)]


def _sentence(where: str, law: str, effect: str, advice: str) -> str:
    return f"forces act on {where} that the law '{law}' does not receive; {effect}: {advice}"


def _advice(sources: str) -> str:
    return f"choose controller.external_torque.source {sources} or 'known'"


def uncompensated_friction(
    tolerable: float, parameters: ControllerParameters, law: FollowingLaw
) -> list[str]:
    """Return a warning about uncompensated joint friction of a tool among hard regions.

    Args:
        tolerable: Deflection of the tool without a warning [m].
        parameters: The controller.
        law: Its law.
    """
    compensated = parameters.friction.source != "none"
    among_regions = parameters.manifold == "space" and np.isfinite(tolerable)
    if compensated or not among_regions or law.linearization.relative_degree == 1:
        return []
    return [
        f"the law '{parameters.law}' does not compensate friction, whose deflection moves the tool "
        "into hard regions: choose controller.friction.source 'observer' or 'model'"
    ]


def largest_force(
    forces: Sequence[ForcePulse], hands: Iterable[HandParameters | LiveHandParameters]
) -> float:
    """Return the largest external force on a tool [N].

    Args:
        forces: Pulses; those on links do not count.
        hands: Hands on the tool.
    """
    pulses = [pulse for pulse in forces if not pulse.link]
    together = [
        sum(np.linalg.norm(other.force) for other in pulses if other.begin <= t < other.end)
        for t in (pulse.begin for pulse in pulses)
    ]
    force = float(max(together, default=0.0))
    for hand in hands:
        force += hand.force_limit
    return force


def _is_exact(law: str, robot: RobotModel) -> bool:
    """Return whether a law computes the acceleration of the links from the joints' deflection."""
    return LAWS[law].inverts_springs and robot.is_elastic


def _deflection(
    sampled: SampledRobot, robot: RobotModel, law: FollowingLaw, rest: RestPosture
) -> float:
    """Return the deflection of the tool [m/N]; NaN where the loop is unstable."""
    if sampled.rate(law.gains, RobotError()) > 0.0:
        return np.nan
    loop, period = sampled.loop, sampled.period
    return largest_deflection(robot, law.linearization, law.gains, loop, rest, period)


def tolerable_deflection(
    manifold: str, fixtures: FixtureParameters | None, compliance: ComplianceParameters
) -> float:
    """Return the deflection of a tool without a warning [m], infinite for a compliant tool.

    Args:
        manifold: Kind of manifold that it follows.
        fixtures: Regions that it may not enter, if there are any.
        compliance: Its compliance.
    """
    across = compliance.transversal.stiffness
    if manifold == "space":
        hard = fixtures and any(region.stiffness is None for region in fixtures.regions)
        return fixtures.bound if fixtures and hard else np.inf
    complies = bool(across.at) or np.isfinite(across.value)
    return np.inf if complies else _LARGEST_DEFLECTION
