"""Forces that a law is not told of, and how far they will move the tool."""

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

# s, for which a force is followed, and at how many instants it is looked at
_LASTING, _INSTANTS = 3.0, 3000
_TOOL_VELOCITY = slice(12, 15)


def largest_yield(
    robot: RobotModel,
    linearization: Linearization,
    gains: LoopGains,
    loop: LoopAtRest,
    rest: RestPosture,
    period: float,
) -> float:
    """Return how far a tool at rest goes for each newton that the law is not told of [m/N].

    The force begins at once, lasts for 3 s, and points where the tool is the softest. The way is
    that across a path or a surface, and in space the whole. Of a rigid robot it tends to
    ``1 / (m a_1)``, with ``1/m`` the largest eigenvalue of ``J (D_E + D_M)^-1 J'`` and
    ``a_1 = p^2`` of a double pole. Laws for elastic joints take the force for motion of the links,
    which tends to ``J (a_3 - D_E^-1 K) D_E^-1 J' / a_1``, K being ``K_d`` (r = 3) or ``K_s``
    (r = 4). An integral part takes it away again; the largest way counts. Friction, which holds,
    is left out.

    Args:
        robot: The robot, as the law believes it.
        linearization: The law, which commands torques.
        gains: Gains of all coordinates, and of the posture if there is one.
        loop: The law on the robot at rest.
        rest: Where it rests.
        period: Sampling time [s].
    """
    motion, n = tool_motion_function(robot), robot.dimension
    J = np.hstack([np.array(motion(rest.q_J, along))[_TOOL_VELOCITY] for along in np.eye(n)])
    slopes = np.array(decoupling_function(robot, linearization.manifold)(rest.q_J, rest.point))
    across = slopes[indices(linearization.manifold.coordinates, Kind.TRANSVERSAL)]
    A, B, C = loop.pushed(gains)
    size, stride = len(A), math.ceil(_LASTING / (_INSTANTS * period))
    step = np.block([[A, B @ J.T], [np.zeros((3, size)), np.eye(3)]])
    step = np.linalg.matrix_power(step, stride)
    ways, state, farthest = (across if len(across) else J) @ C, np.zeros((size, 3)), 0.0
    for _ in range(math.ceil(_LASTING / (stride * period))):
        state = step[:size, :size] @ state + step[:size, size:]
        farthest = max(farthest, float(np.linalg.norm(ways @ state, 2)))
    return farthest


_DEFLECTIONS = "it takes them for deflections of the joints and may leave the path"
# m, beside a path or a surface that does not yield
_LARGEST_WAY = 1e-3


@dataclass(frozen=True)
class ExpectedForces:
    """Forces from outside that are known beforehand.

    Attributes:
        tool: The largest on the tool, without what only slows it down [N].
        on_links: Whether some act on links.
        holds_back: Whether one slows the tool down.
    """

    tool: float
    on_links: bool
    holds_back: bool


def untold_forces(
    forces: ExpectedForces,
    bearable: float,
    parameters: ControllerParameters,
    robot: RobotModel,
    law: FollowingLaw,
    rest: RestPosture,
    sampled: Callable[[], SampledRobot],
) -> list[str]:
    """Return what forces will do that a law is not told of, one sentence each.

    Servos of velocities bear them, and an observer of disturbances takes them for friction.

    Args:
        forces: What acts from outside.
        bearable: How far the tool may give way without a word [m], see :func:`bearable_way`.
        parameters: The controller.
        robot: The robot, as it is believed.
        law: Its law.
        rest: The start, and the manifold's point there.
        sampled: Returns the law, if it commands torques, on its robot at rest.
    """
    force, source = forces.tool, parameters.external_torque.source
    exact = _is_exact(parameters.law, robot)
    if exact and forces.on_links and source in ("none", "measured"):
        # the sensor in the flange does not see what acts on links
        return [_sentence("links", parameters.law, _DEFLECTIONS, _tell("'observed'"))]
    friction = parameters.friction
    observed = friction.source == "observer" and friction.observer == "disturbance"
    if source != "none" or (observed and not exact) or law.linearization.relative_degree == 1:
        return []
    if bearable == np.inf and not exact:
        return []
    way = force * _yield(sampled(), robot, law, rest) if force else 0.0
    if not way > bearable and not (exact and (force or forces.holds_back)):
        return []
    effect = _DEFLECTIONS if exact else "it gives way to them like a spring"
    if way > 0.0:
        effect += f", {force:g} N that come at once by up to {1e3 * way:.2g} mm"
    if parameters.manifold == "space" and way > bearable:
        effect += f", also into hard regions (fixtures.bound = {1e3 * bearable:g} mm)"
    advice = _tell("'measured', 'observed'")
    if law.stabilization.is_free.any():  # a hand leads what it is not told of
        advice = "choose faster poles or an integral part across"
    return [_sentence("the tool", parameters.law, effect, advice)]


def _sentence(where: str, law: str, effect: str, advice: str) -> str:
    return f"forces act on {where} that the law '{law}' does not know of; {effect}: {advice}"


def _tell(sources: str) -> str:
    return f"choose controller.external_torque.source {sources} or 'known'"


def untold_friction(
    bearable: float, parameters: ControllerParameters, law: FollowingLaw
) -> list[str]:
    """Return what joints' friction does to a tool among hard regions that is not compensated.

    Args:
        bearable: How far the tool may give way without a word [m].
        parameters: The controller.
        law: Its law.
    """
    compensated = parameters.friction.source != "none"
    led = parameters.manifold == "space" and np.isfinite(bearable)
    if compensated or not led or law.linearization.relative_degree == 1:
        return []
    return [
        f"the law '{parameters.law}' does not compensate friction, and by what it gives "
        "way to that the tool enters hard regions: choose controller.friction.source 'observer' "
        "or 'model'"
    ]


def largest_force(
    forces: Sequence[ForcePulse], hands: Iterable[HandParameters | LiveHandParameters]
) -> float:
    """Return the largest force that may act on a tool from outside [N].

    Args:
        forces: Pulses; those on links do not count.
        hands: On the tool.
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
    """Return whether a law makes of bending joints what accelerates the links."""
    return LAWS[law].inverts_springs and robot.is_elastic


def _yield(sampled: SampledRobot, robot: RobotModel, law: FollowingLaw, rest: RestPosture) -> float:
    """Return how far the tool gives way [m/N]; NaN where the loop is unstable."""
    if sampled.rate(law.gains, RobotError()) > 0.0:
        return np.nan
    loop, period = sampled.loop, sampled.period
    return largest_yield(robot, law.linearization, law.gains, loop, rest, period)


def bearable_way(
    manifold: str, fixtures: FixtureParameters | None, compliance: ComplianceParameters
) -> float:
    """Return how far a tool may give way without a word [m], infinite where it is to yield.

    Args:
        manifold: Which kind of manifold it follows.
        fixtures: Regions that it may not enter, if there are any.
        compliance: How it yields to forces.
    """
    across = compliance.transversal.stiffness
    if manifold == "space":
        hard = fixtures and any(region.stiffness is None for region in fixtures.regions)
        return fixtures.bound if fixtures and hard else np.inf
    yields = bool(across.at) or np.isfinite(across.value)
    return np.inf if yields else _LARGEST_WAY
