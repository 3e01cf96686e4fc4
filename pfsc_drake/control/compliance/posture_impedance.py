"""Null-space compliance of redundant joints: a compliant posture reference."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import companion, expm

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.law.decoupling import free_torque, scale_of
from pfsc_drake.control.law.posture import POTENTIALS, Posture, free_motion_function
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.yaml.rules import NotNegative, Parameters, Positive


@dataclass
class NullSpaceImpedanceParameters(Parameters):
    """Impedance of every joint in the null space.

    Attributes:
        inertia: ``m`` [kg m^2 or kg], positive.
        damping: ``d`` [Nm s/rad or N s/m], positive.
        stiffness: ``k`` [Nm/rad or N/m]; zero for a posture that does not return.
        filter_rate: ``w`` of the filter that smooths the posture [rad/s].
    """

    inertia: Positive = 1.0
    damping: Positive = 20.0
    stiffness: NotNegative = 50.0
    filter_rate: Positive = 30.0


@dataclass
class NullSpaceImpedance:
    """Compliant posture reference ``q_0``, with the same impedance for every joint.

    It obeys ``(m s^2 + d s + k) (s / w + 1)^(r - 1) q_0 = u + k q_goal``.

    The torque u is the part of the joints' external torques that does no work on the outputs,
    ``N' tau`` (:func:`~pfsc_drake.control.law.decoupling.free_torque`), so that forces on the tool
    along its outputs do not change the posture. The filter of order r - 1 makes q_0 continuous up
    to its r-th derivative, which a law of relative degree r follows exactly. Torques are constant
    over a sampling interval, over which the equation is solved exactly.

    The motion consists of the derivatives 0..r of q_0 by rows, shape ((r + 1) N,).

    Attributes:
        parameters: The impedance.
        relative_degree: ``r`` of the law that follows the posture, 1 to 4.
        period: Sampling time [s].
    """

    parameters: NullSpaceImpedanceParameters
    relative_degree: int
    period: float
    _transition: ca.DM = field(init=False, repr=False)
    _response: ca.DM = field(init=False, repr=False)

    def __post_init__(self) -> None:
        p, order = self.parameters, self.relative_degree + 1
        polynomial = np.array([p.inertia, p.damping, p.stiffness])
        for _ in range(self.relative_degree - 1):
            polynomial = np.polymul(polynomial, [1.0 / p.filter_rate, 1.0])
        # derivatives in increasing order, one more row for the input
        system = np.zeros((order + 1, order + 1))
        system[:order, :order] = companion(polynomial)[::-1, ::-1]
        system[order - 1, order] = 1.0 / polynomial[0]
        step = expm(system * self.period)
        self._transition = ca.DM(step[:order, :order])
        self._response = ca.DM(step[:order, order])

    def start(self, posture: Any) -> Any:
        """Return the motion at rest in a posture as an expression, shape ((r + 1) N,).

        Args:
            posture: Shape (N,) [rad or m].
        """
        return ca.vertcat(posture, ca.DM.zeros(self.relative_degree * posture.numel()))

    def update(self, motion: Any, torque: Any, goal: Any) -> Any:
        """Return the motion one period later as an expression, shape ((r + 1) N,).

        Args:
            motion: Derivatives of the posture, see the class.
            torque: u, shape (N,) [Nm or N]; replaced by zero unless all entries are finite.
            goal: ``q_goal``, shape (N,).
        """
        force = self.parameters.stiffness * goal + where(all_finite(torque), torque, 0.0)
        derivatives = ca.reshape(motion, goal.numel(), self.relative_degree + 1)
        return ca.vec(derivatives @ self._transition.T + force @ self._response.T)


# share of a joint's velocity limit, the largest speed of a posture under its pull
_LARGEST_SPEED = 0.5


class CompliantPosture(Block):
    """A :class:`NullSpaceImpedance` under external torques and the pull of a potential.

    With the null-space projection ``N'``, which does not affect the outputs, the posture ``q_0`` is
    driven by ``u = N' (tau_ext + pull_stiffness (-dV/dq))``.

    The pull of spring and potential is scaled down as a whole where it would move a joint, against
    the damper alone, faster than half its velocity limit: far from its goal a posture must not use
    the speed that the drives need for the outputs.

    The posture starts at rest at the present joint positions, and moves smoothly to its goal. If
    torques, joint state or manifold point contain NaN or infinite values, only the spring acts.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        manifold_point (input): Projection of the tool onto the manifold.
        tau_ext (input, optional): External torques that move the posture, shape (N,) [Nm or N].
        posture_reference (output): Derivatives 0..r of ``q_0`` by rows, shape ((r + 1) N,).

    State:
        motion: The output. goal: Rest position of the spring, shape (N,).

    Args:
        robot: The robot, N joints.
        manifold: Manifold that the robot follows.
        posture: Posture control of the law; its weight determines the projection.
        impedance: Impedance of the posture.
        potential: ``V``, one of ``POTENTIALS``, or empty for none.
        pull_stiffness: Stiffness of the potential [Nm/rad or N/m], not negative.
        goal: Goal of the posture, shape (N,) [rad or m]; None for the start posture.

    Raises:
        InputError: If the potential is unknown, or its stiffness negative.
    """

    def __init__(
        self,
        robot: RobotModel,
        manifold: Manifold,
        posture: Posture,
        impedance: NullSpaceImpedance,
        potential: str = "",
        pull_stiffness: float = 0.0,
        goal: np.ndarray | None = None,
    ) -> None:
        if potential and potential not in POTENTIALS:
            raise InputError(f"potential: '{potential}'; must be one of {', '.join(POTENTIALS)}")
        if not 0.0 <= pull_stiffness < np.inf:
            raise InputError(
                f"pull_stiffness: {pull_stiffness}; must be zero or positive, and finite"
            )
        self._impedance, self._n, self._goal = impedance, robot.dimension, goal
        self._pulls = pull_stiffness if potential else 0.0
        self._free = _free_torques_function(robot, manifold, posture, potential, self._pulls)
        speed = _LARGEST_SPEED * robot.gather("velocity_limit")
        self._largest = ca.DM(impedance.parameters.damping * speed)
        n, size = robot.dimension, (impedance.relative_degree + 1) * robot.dimension
        self.inputs = {
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "manifold_point": Port(manifold.layout.size),
            "tau_ext": Port(n, "Nm or N", optional=True),
        }
        self.outputs = {"posture_reference": Port(size, "rad or m, per s, ..")}
        self.states = {"motion": size, "goal": n}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        q = u.joint_state[: self._n]
        goal = q if self._goal is None else ca.DM(self._goal)
        return {"motion": self._impedance.start(q), "goal": goal}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"posture_reference": x.motion}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        q_0 = x.motion[: self._n]
        free, pull = 0.0, self._impedance.parameters.stiffness * (x.goal - q_0)
        if u.tau_ext is not None or self._pulls:
            torque = ca.DM.zeros(self._n) if u.tau_ext is None else u.tau_ext
            yielded, pulled = self._free(u.joint_state[: self._n], u.manifold_point, torque)
            free, pull = yielded + pulled, pull + pulled
        excess = ca.fmax(ca.norm_inf(pull / self._largest), 1.0)
        free = free - (1.0 - 1.0 / excess) * pull
        return {"motion": self._impedance.update(x.motion, free, x.goal)}


@once_per_content()
def _free_torques_function(
    robot: RobotModel, manifold: Manifold, posture: Posture, potential: str, stiffness: float
) -> ca.Function:
    """Return ``(q, manifold_point, torque) -> (free, pulled)``, the last three (N,).

    These are the parts of external torques and pull that do no work on the outputs; zero if an
    input is NaN or infinite.
    """
    q, torque = ca.SX.sym("q", robot.dimension), ca.SX.sym("torque", robot.dimension)
    point = ca.SX.sym("manifold_point", manifold.layout.size)
    inertial = posture.weight is None
    A, pull, weight = free_motion_function(robot, manifold, potential, inertial=inertial)(q, point)
    scale = scale_of(weight) if inertial else posture.scale
    finite = all_finite(A, pull, torque)
    free = where(finite, free_torque(A, torque, scale), 0.0)
    pulled = where(finite, free_torque(A, stiffness * pull, scale), 0.0)
    return ca.Function(
        "free_torques",
        [q, point, torque],
        ca.cse([ca.densify(free), ca.densify(pulled)]),
        ["q", "manifold_point", "torque"],
        ["free", "pulled"],
    )
