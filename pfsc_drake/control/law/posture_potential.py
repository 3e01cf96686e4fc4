"""What pulls a posture, beside a spring: away from joint limits, towards good conditioning."""

import casadi as ca
import numpy as np

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.linearization import decoupling_function
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.robot.inverse_kinematics import UNLIMITED
from pfsc_drake.robot.robot_model import RobotModel

POTENTIALS = ("limits", "conditioning")

# of the limits' potential, by how much it steepens: its second derivative is 4 times that of the
# middle at a limit
_STEEPENING = 0.5
# of the conditioning's gradient, up to which it grows [rad]
_LARGEST_PULL = 1.0


@once_per_content()
def free_motion_function(
    robot: RobotModel, manifold: Manifold, potential: str = "", *, inertial: bool = False
) -> ca.Function:
    """Return what decides how a posture may move, and how it is pulled, ``-dV/dq``.

    ``limits``: ``V = sum h^2 (x^2 + x^4 / 2) / 2`` over the joints with limits, x being the
    distance from the middle over half the range h: near the middle a spring of stiffness one, at
    a limit four times as stiff. Joints without limits are not pulled.

    ``conditioning``: ``V = -log(det(A A')) / 2``, the manipulability of the outputs (rows in m
    and rad) on the manifold as it is. Near singular postures its gradient g grows over all
    bounds; ``g / sqrt(1 + |g|^2)`` is used.

    Args:
        robot: The robot.
        manifold: What it follows.
        potential: One of ``POTENTIALS``, or empty for none.
        inertial: Whether motions are weighed by the robot's inertia.

    Returns:
        CasADi function ``(q, manifold_point) -> (A, pull, weight)``, shapes (m, N), (N,) [rad or
        m] and, inertial, (N, N), else (N,) of ones.
    """
    q = ca.SX.sym("q", robot.dimension)
    point = ca.SX.sym("manifold_point", manifold.layout.size)
    A = decoupling_function(robot, manifold)(q, point)
    pull, weight = ca.SX(robot.dimension, 1), ca.SX.ones(robot.dimension)
    if potential == "limits":
        pull = _from_limits(robot, q)
    elif potential == "conditioning":
        pull = _to_good_conditioning(q, A)
    if inertial:
        weight = robot.mass_matrix(q) + ca.diag(robot.D_M)
    return ca.Function(
        "free_motion",
        [q, point],
        ca.cse([A, ca.densify(pull), ca.densify(weight)]),
        ["q", "manifold_point"],
        ["A", "pull", "weight"],
    )


def _from_limits(robot: RobotModel, q: ca.SX) -> ca.SX:
    lower, upper = np.clip(robot.gather("position_limits"), -UNLIMITED, UNLIMITED).T
    limited = upper - lower < UNLIMITED
    half = np.where(limited, (upper - lower) / 2.0, 1.0)
    middle = np.where(limited, (upper + lower) / 2.0, 0.0)
    x = (q - middle) / half
    return -ca.DM(limited * half) * (x + 2.0 * _STEEPENING * x**3)


def _to_good_conditioning(q: ca.SX, A: ca.SX) -> ca.SX:
    factor, _, _ = ca.ldl(A @ A.T)
    gradient = ca.gradient(ca.sum1(ca.log(factor)) / 2.0, q)
    return gradient * (_LARGEST_PULL / ca.sqrt(_LARGEST_PULL**2 + ca.sumsqr(gradient)))
