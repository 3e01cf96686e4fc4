"""Where a robot will be when torques act that are told now."""

import math
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import is_finite, where
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import MAY_BE_PARAMETRIC, RobotModel, bias_torque

# of the series; a resonance of 500 rad/s over 3 ms is exact to 1e-8
_TERMS = 10
# beyond it no law for elastic joints has been seen to hold
MOST_TICKS = 10


def advanced(
    robot: RobotModel, state: ca.SX, torques: list[ca.SX], period: float, age: float = 0.0
) -> ca.SX:
    """Return the joint state after torques that are known have acted, one after another.

    Inertia and weight are those of the posture in the middle of the time, springs and dampers of
    the joints exact: every derivative of the motion follows from the two before it by (2.65), and
    the state is the sum of a Taylor series.

    Args:
        robot: The robot, N joints, any of them elastic.
        state: ``[q_J, v_J, q_M, v_M]``, shape (4N, 1).
        torques: What acted in the interval before, and what acts in each of those that follow
            [Nm or N], each (N, 1).
        period: How long each acts [s].
        age: How old the velocities of ``state`` are [s], not more than the period.

    Returns:
        Shape (4N, 1).
    """
    n, elastic = robot.dimension, ca.DM(robot.elastic_joints.astype(float))
    ahead = (len(torques) - 1) * period
    q_J, v_J, q_M, v_M = ca.vertsplit(state, n)
    middle = q_J + 0.5 * (ahead - age) * v_J
    D = robot.mass_matrix(middle) + ca.diag(ca.DM(~robot.elastic_joints) * robot.D_M)
    factors, weight = ca.ldl(ca.densify(D)), bias_torque(robot, middle, v_J)
    K_s = ca.sparsify(robot.springs)
    K_d = ca.sparsify(ca.DM(np.where(robot.elastic_joints, robot.K_d, 0.0)))
    f_v, D_M = ca.DM(robot.viscous_damping), ca.DM(robot.D_M)

    def next_but_one(q: list[ca.SX], v: list[ca.SX], load: Any, tau: Any) -> list[ca.SX]:
        """Return the second derivatives of links and motors."""
        spring = K_s * (q[1] - q[0]) + K_d * (v[1] - v[0])
        drive = tau - f_v * v[1]
        a_J = ca.ldl_solve(spring + (1.0 - elastic) * drive - load, *factors)
        return [a_J, elastic * (drive - spring) / D_M + (1.0 - elastic) * a_J]

    if age:
        between = [q_J - 0.5 * age * v_J, q_M - 0.5 * age * v_M]
        a = next_but_one(between, [v_J, v_M], weight, torques[0])
        v_J, v_M = v_J + age * a[0], v_M + age * a[1]
    for tau in torques[1:]:
        terms = [[q_J, q_M], [v_J, v_M]]
        for k in range(_TERMS):
            known = (weight, tau) if k == 0 else (0.0, 0.0)
            terms.append(next_but_one(terms[k], terms[k + 1], *known))
        scale = [period**k / math.factorial(k) for k in range(len(terms))]
        q_J, q_M, v_J, v_M = (
            sum(s * term[i] for s, term in zip(scale, terms[first:], strict=False))
            for first in (0, 1)
            for i in (0, 1)
        )
    return ca.vertcat(q_J, v_J, q_M, v_M)


@once_per_content()
def _advance(robot: RobotModel, ticks: int, period: float, age: float) -> ca.Function:
    """Return ``(state, sent) -> state`` as :func:`advanced` makes it, torques oldest first."""
    n = robot.dimension
    state, sent = ca.SX.sym("state", 4 * n), ca.SX.sym("sent", (ticks + 1) * n)
    told = advanced(robot, state, ca.vertsplit(sent, n), period, age)
    return ca.Function(
        "advance", [state, sent], ca.cse([told]), ["state", "sent"], ["told"], MAY_BE_PARAMETRIC
    )


class StatePredictor(Block):
    """Tells the joint state of the moment at which torques act that are told now.

    A robot that acts on torques d ticks after they were told is, for its law, one without delay
    whose state is that of d ticks later: it follows from what is measured, from the torques that
    are on their way, and from the model, see :func:`advanced`. An error of the model is an error of
    d ticks' motion alone. Velocities that are older than positions are brought up to them, too.
    What cannot be foretold, because something of the state is no number, is passed on as it is
    measured: by that a robot can still be stopped and held.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        drive_torque (input): What the drives are told, within their limits [Nm or N], shape (N,).
        friction_torque (input, optional): What friction is believed to take of it.
        joint_state (output): The same of d ticks later, shape (4N,). What drives the joints may
            depend on it.

    State:
        What was ``sent``, the oldest first, less friction, shape ((d + 1) N,). At the start that
        is the links' weight.

    Args:
        robot: The robot as it is believed, N joints.
        ticks: d, 0 to 10.
        period: Sampling time T [s].
        age: How old measured velocities are [s], 0 to T.

    Raises:
        InputError: If a number is out of range.
    """

    def __init__(self, robot: RobotModel, ticks: int, period: float, age: float = 0.0) -> None:
        if not 0 <= ticks <= MOST_TICKS:
            raise InputError(
                f"delay: {ticks} ticks of {period:g} s; must be 0 to {MOST_TICKS} of them"
            )
        if not 0.0 <= age <= period:
            raise InputError(f"age of velocities: {age:g} s; must be 0 to {period:g} s")
        n = robot.dimension
        self._n, self._advance = n, _advance(robot, ticks, period, age)
        # what holds the links still
        self._weight = ca.Function(
            "weight",
            [self._advance.sx_in(0)],
            [bias_torque(robot, self._advance.sx_in(0)[:n], ca.SX(n, 1))],
            MAY_BE_PARAMETRIC,
        )
        self._ticks = ticks
        self.inputs = {
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "drive_torque": Port(n, "Nm or N"),
            "friction_torque": Port(n, "Nm or N", optional=True),
        }
        self.outputs = {"joint_state": Port(4 * n, "rad, rad/s or m, m/s")}
        self.states = {"sent": (ticks + 1) * n}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero."""
        return {"sent": ca.repmat(self._weight(u.joint_state), self._ticks + 1, 1)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        told = self._advance(u.joint_state, x.sent)
        return {"joint_state": where(is_finite(told), told, u.joint_state)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        net = u.drive_torque
        if u.friction_torque is not None:
            net = net - u.friction_torque
        return {"sent": ca.vertcat(x.sent[self._n :], net)}
