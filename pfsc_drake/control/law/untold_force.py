"""How far a force moves a tool that its law is not told of."""

import math

import numpy as np

from pfsc_drake.control.law.linearization import Linearization, decoupling_function
from pfsc_drake.control.law.loop_at_rest import LoopAtRest, RestPosture
from pfsc_drake.control.law.stabilization import LoopGains
from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import indices
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
        gains: Of all coordinates, and of the posture if there is one.
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
