"""What no sensor tells of a robot's state: links behind elastic joints, and a few ticks on."""

import math
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import is_finite, where
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.estimation.filters import SignalDerivatives
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import (
    MAY_BE_PARAMETRIC,
    RobotModel,
    bias_torque,
    link_acceleration,
)

# an acceleration that the model does not know is followed without lag while it stays
_DEGREE = 2


class LinkState(Block):
    """Finds positions and velocities of links from motors and the torques of their springs.

    A torque ``tau_J = K_s (q_M - q_J) + K_d (v_M - v_J)`` tells where a link is, and by (2.65a) how
    it is accelerated. So its velocity is no derivative of what is measured: a fading-memory
    polynomial filter (:class:`SignalDerivatives`) follows position, velocity and what acceleration
    the model does not know, of forces from outside and of wrong masses::

        q_J = q_M - (tau_J - K_d (v_M - v_J)) / K_s            what it is corrected by
        q_J'' = D_E^-1(q_J) (tau_J - n_E(q_J, v_J)) + unknown  what it expects

    with the spring's torque of the middle of the coming interval,
    ``tau_J + K_s (v_M - v_J) T / 2``. Rigid joints have one side.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, of elastic joints the motors' side alone is
            read, shape (4N,).
        joint_torque (input): Torques of the springs and dampers, shape (N,) [Nm or N].
        joint_state (output): The same with the links' side found, shape (4N,).

    State:
        The filter's ``prediction`` of positions, velocities and unknown accelerations.

    Args:
        robot: The robot as it is believed, N joints.
        bandwidth: Rate at which the filter forgets [rad/s].
        period: Sampling time [s].

    Raises:
        InputError: If the bandwidth is out of range.
    """

    def __init__(self, robot: RobotModel, bandwidth: float, period: float) -> None:
        n, elastic = robot.dimension, robot.elastic_joints
        self._n, self._period = n, period
        self._filter = SignalDerivatives(_DEGREE, bandwidth, period)
        self._acceleration = link_acceleration(robot)
        self._elastic = ca.DM(elastic.astype(float))
        self._damping = ca.DM(np.where(elastic, robot.K_d, 0.0))
        self._springs = ca.Function("springs", [], [robot.springs], MAY_BE_PARAMETRIC)
        self.inputs = {
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "joint_torque": Port(n, "Nm or N"),
        }
        self.outputs = {"joint_state": Port(4 * n, "rad, rad/s or m, m/s")}
        self.inner = {"estimate": (_DEGREE + 1) * n}
        self.states = {"prediction": (_DEGREE + 1) * n}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero."""
        _, _, q_M, _ = ca.vertsplit(u.joint_state, self._n)
        return {"prediction": self._filter.start(q_M - self._deflection(u.joint_torque))}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        n = self._n
        _, _, q_M, v_M = ca.vertsplit(u.joint_state, n)
        spring = u.joint_torque - self._damping * (v_M - x.prediction[n : 2 * n])
        sample = q_M - self._deflection(spring)
        estimate = self._filter.estimate(x.prediction, sample)
        v_J = estimate[n : 2 * n]
        v_J = self._elastic * v_J + (1.0 - self._elastic) * v_M
        return {"joint_state": ca.vertcat(sample, v_J, q_M, v_M), "estimate": estimate}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        n, T = self._n, self._period
        q_J, v_J, _, v_M = ca.vertsplit(y.joint_state, n)
        torque = u.joint_torque + self._springs()["o0"] * (v_M - v_J) * (T / 2.0)
        a = self._acceleration(q_J, v_J, torque)
        known = ca.vertcat(a * (T**2 / 2.0), a * T, ca.DM.zeros(n))
        return {"prediction": self._filter.predict(y.estimate) + known}

    def _deflection(self, spring: Any) -> Any:
        """Return by how much springs are bent, zero in rigid joints."""
        stiffness = self._springs()["o0"] + (1.0 - self._elastic)
        return self._elastic * spring / stiffness


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
