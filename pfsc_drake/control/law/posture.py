"""Posture control of redundant joints: reference, weight, and potentials."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.actuation import joint_jets
from pfsc_drake.control.law.linearization import decoupling_function
from pfsc_drake.control.law.stabilization import Stabilization
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.inverse_kinematics import UNLIMITED
from pfsc_drake.robot.robot_model import RobotModel

# an angle [rad] that depends on the joints, as a map of jets
PostureCoordinate = Callable[[Sequence[Jet]], Jet]

# rad, the range of a joint without limits
_WHOLE_TURN = 2.0 * np.pi
# s, time constant of joints that come to rest at their ends
_TO_END = 0.1


@dataclass(frozen=True)
class Posture:
    """Tracking of a posture reference ``q_0(t)`` by N joints in the null space of the outputs.

    The desired highest joint derivative follows from linear error dynamics::

        w = q_0^(r) - sum_k a_{k+1} (q - q_0)^(k)

    and the solution for the outputs has the least weighted deviation from it. With a coordinate
    ``c(q)`` of the joints, its error ``c(q) - c(q_0)`` obeys the same linear dynamics exactly,
    independent of the outputs, as long as it can move without them.

    Attributes:
        stabilization: Gains of the joints' deviations from the reference, all of one kind.
        weight: ``W``'s diagonal, shape (N,): a joint of larger weight deviates less; None for
            the robot's inertia in its present posture, rotors included.
        coordinate: Further controlled coordinate; None for none.
        speeds: Largest joint speeds by posture and outputs together, shape (N,), infinite for any;
            None for no restraint.
        ends: Lowest and highest joint coordinates for the posture, shape (2, N); None for any.

    Raises:
        InputError: If a weight is not positive, or is not one per joint.
    """

    stabilization: Stabilization
    weight: np.ndarray | None
    coordinate: PostureCoordinate | None = None
    speeds: np.ndarray | None = None
    ends: np.ndarray | None = None

    def __post_init__(self) -> None:
        n, weight = self.stabilization.proportional.shape[1], self.weight
        if weight is not None and (np.shape(weight) != (n,) or not 0.0 < np.min(weight) < np.inf):
            raise InputError(f"posture weight: {weight}; must be {n} positive numbers")

    @property
    def settling(self) -> float:
        """Divisor from the desired highest derivative to a velocity.

        ``a_2``, by which ``w`` changes with the joints' velocity; 1 where it is a velocity.
        """
        gains = self.stabilization.proportional
        return float(gains[1][0]) if len(gains) > 1 else 1.0

    def to_ends(self, q: ca.SX) -> ca.SX | None:
        """Return the largest speeds of joints upwards and downwards in view of their ends.

        Args:
            q: Joint coordinates, shape (N, 1).

        Returns:
            Shape (N, 2), or None for any.
        """
        if self.ends is None:
            return None
        lowest, highest = self.ends
        return ca.horzcat(highest - q, q - lowest) / _TO_END

    @property
    def scale(self) -> np.ndarray | None:
        """``S`` with ``S S' = W^-1``, shape (N, N), if it is constant and not the identity."""
        if self.weight is None or np.all(self.weight == 1.0):
            return None
        return np.diag(1.0 / np.sqrt(self.weight))


class PostureExpressions(NamedTuple):
    """Demands of a posture, as expressions.

    Attributes:
        desired: Highest joint derivative ``w``, shape (N, 1).
        rest: The same without a goal, ``-sum_k a_{k+1} q^(k)`` from k = 1 on, by which joints come
            to rest, shape (N, 1).
        weight: ``W``, shape (N, N), if it varies, else empty.
        slope: ``dc/dq`` of the coordinate, shape (N, 1), or empty.
        rate: Desired ``dc/dq q^(r)`` of the coordinate, shape (1, 1), or empty.
    """

    desired: ca.SX
    rest: ca.SX
    weight: ca.SX
    slope: ca.SX
    rate: ca.SX


def posture_expressions(
    posture: Posture, robot: RobotModel, motion: Sequence[ca.SX], reference: Sequence[ca.SX]
) -> PostureExpressions:
    """Return the demands of a posture.

    Args:
        posture: The posture.
        robot: The robot, N joints.
        motion: Joint coordinates and derivatives, orders 0..r-1, each (N, 1).
        reference: Posture reference and derivatives, orders 0..r, each (N, 1).
    """
    empty, stabilization = ca.SX(0, 1), posture.stabilization
    desired = stabilization.virtual_input(motion, reference, ca.SX(robot.dimension, 1))
    rest = ca.SX(robot.dimension, 1)
    for gains, derivative in zip(stabilization.proportional[1:], motion[1:], strict=True):
        rest -= ca.SX(gains) * derivative
    weight = empty
    if posture.weight is None:
        weight = robot.mass_matrix(motion[0]) + ca.diag(robot.D_M)
    if posture.coordinate is None:
        return PostureExpressions(desired, rest, weight, empty, empty)
    actual = posture.coordinate(joint_jets([*motion, ca.SX(robot.dimension, 1)]))
    desired_coordinate = posture.coordinate(joint_jets(reference))
    q = ca.SX.sym("q", robot.dimension)
    angle = posture.coordinate(joint_jets([q, ca.SX(robot.dimension, 1)])).coefficients[0]
    slope = ca.substitute(ca.gradient(angle, q), q, motion[0])
    rate = desired_coordinate.derivative(stabilization.relative_degree) - actual.derivative(
        stabilization.relative_degree
    )
    for k, gains in enumerate(stabilization.proportional):
        error = actual.derivative(k) - desired_coordinate.derivative(k)
        if k == 0:  # the shorter direction
            error = ca.atan2(ca.sin(error), ca.cos(error))
        rate = rate - gains[0] * error
    return PostureExpressions(desired, rest, weight, ca.densify(slope), rate)


def range_weight(robot: RobotModel) -> np.ndarray:
    """Return the weight for deviations in proportion to the joint ranges, shape (N,).

    Args:
        robot: The robot; joints without limits count as one revolution.
    """
    lower, upper = robot.gather("position_limits").T
    span = np.where(np.abs(upper - lower) < UNLIMITED, upper - lower, _WHOLE_TURN)
    return (np.max(span) / span) ** 2


POTENTIALS = ("limits", "conditioning")

# steepening of the limits' potential: its second derivative at a limit is 4 times that in the
# middle
_STEEPENING = 0.5
# largest gradient of the conditioning [rad]
_LARGEST_PULL = 1.0


@once_per_content()
def free_motion_function(
    robot: RobotModel, manifold: Manifold, potential: str = "", *, inertial: bool = False
) -> ca.Function:
    """Return the null space of a posture, and the pull of its potential, ``-dV/dq``.

    ``limits``: ``V = sum h^2 (x^2 + x^4 / 2) / 2`` over the joints with limits, x being the
    distance from the middle over half the range h: near the middle a spring of stiffness one, at
    a limit four times as stiff. Joints without limits are not pulled.

    ``conditioning``: ``V = -log(det(A A')) / 2``, the manipulability of the outputs (rows in m
    and rad) on the present manifold. Near singular postures its gradient g is unbounded;
    ``g / sqrt(1 + |g|^2)`` is used.

    Args:
        robot: The robot.
        manifold: Followed manifold.
        potential: One of ``POTENTIALS``, or empty for none.
        inertial: Whether the weight is the robot's inertia.

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
