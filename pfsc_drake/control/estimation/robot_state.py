"""Estimation of a robot's state: links behind elastic joints, and prediction over a delay."""

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

# a constant unmodelled acceleration is followed without lag
_DEGREE = 2


class LinkState(Block):
    """Estimates positions and velocities of links from motors and the torques of their springs.

    A torque ``tau_J = K_s (q_M - q_J) + K_d (v_M - v_J)`` determines the position of a link and, by
    (2.65a), its acceleration. The velocity therefore needs no derivative of a measurement: a
    fading-memory polynomial filter (:class:`SignalDerivatives`) estimates position, velocity and
    the unmodelled acceleration, caused by external forces and wrong masses::

        q_J = q_M - (tau_J - K_d (v_M - v_J)) / K_s            correction
        q_J'' = D_E^-1(q_J) (tau_J - n_E(q_J, v_J)) + unknown  prediction

    with the spring's torque in the middle of the next interval,
    ``tau_J + K_s (v_M - v_J) T / 2``. Rigid joints have one side.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,); only the motors' side of elastic
            joints is used.
        joint_torque (input): Torques of the springs and dampers, shape (N,) [Nm or N].
        joint_state (output): Joint state with the estimated links' side, shape (4N,).

    State:
        The filter's ``prediction`` of positions, velocities and unknown accelerations.

    Args:
        robot: Nominal model of the robot, N joints.
        bandwidth: Rate at which the filter forgets old samples [rad/s].
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
        """Return the initial states; omitted ones are zero."""
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
        """Return the states at the next tick; omitted ones keep their values."""
        n, T = self._n, self._period
        q_J, v_J, _, v_M = ca.vertsplit(y.joint_state, n)
        torque = u.joint_torque + self._springs()["o0"] * (v_M - v_J) * (T / 2.0)
        a = self._acceleration(q_J, v_J, torque)
        known = ca.vertcat(a * (T**2 / 2.0), a * T, ca.DM.zeros(n))
        return {"prediction": self._filter.predict(y.estimate) + known}

    def _deflection(self, spring: Any) -> Any:
        """Return the deflections of the springs, zero in rigid joints."""
        stiffness = self._springs()["o0"] + (1.0 - self._elastic)
        return self._elastic * spring / stiffness


# terms of the series; a resonance of 500 rad/s over 3 ms is exact to 1e-8
_TERMS = 10
# no law for elastic joints was stable with longer delays
MOST_TICKS = 10


def advance_state(
    robot: RobotModel, state: ca.SX, torques: list[ca.SX], period: float, age: float = 0.0
) -> ca.SX:
    """Return the joint state after a sequence of known torques.

    Inertia and weight are evaluated at the posture in the middle of the time interval; springs and
    dampers of the joints are exact. Every derivative of the motion follows from the two before it
    by (2.65), and the state is the sum of a Taylor series.

    Args:
        robot: The robot, N joints, any of them elastic.
        state: ``[q_J, v_J, q_M, v_M]``, shape (4N, 1).
        torques: Torques in the previous interval and in each of the following ones [Nm or N],
            each (N, 1).
        period: Duration of each interval [s].
        age: Age of the velocities of ``state`` [s], at most the period.

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
def _advance_function(robot: RobotModel, ticks: int, period: float, age: float) -> ca.Function:
    """Return ``(state, sent) -> state`` of :func:`advance_state`, torques oldest first."""
    n = robot.dimension
    state, sent = ca.SX.sym("state", 4 * n), ca.SX.sym("sent", (ticks + 1) * n)
    predicted = advance_state(robot, state, ca.vertsplit(sent, n), period, age)
    return ca.Function(
        "advance",
        [state, sent],
        ca.cse([predicted]),
        ["state", "sent"],
        ["predicted"],
        MAY_BE_PARAMETRIC,
    )


class StatePredictor(Block):
    """Predicts the joint state at the time at which the present command takes effect.

    A robot that applies torques d ticks after they were commanded is, for its law, a robot without
    delay whose state is the one d ticks later. This state follows from the measurements, from the
    commanded torques that have not yet taken effect, and from the model, see :func:`advance_state`.
    An error of the model affects only the motion of d ticks. Velocities that are older than
    positions are predicted to the same time. If the state contains NaN or infinite entries, the
    measured state is passed through, so that the robot can still be stopped and held at rest.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        drive_torque (input): Commanded drive torques, within their limits [Nm or N], shape (N,).
        friction_torque (input, optional): Estimated friction torque, which is subtracted from it.
        joint_state (output): Joint state d ticks later, shape (4N,). The drive torques may depend
            on it.

    State:
        Commanded torques less friction (``sent``), the oldest first, shape ((d + 1) N,). Initially
        the links' weight.

    Args:
        robot: Nominal model of the robot, N joints.
        ticks: d, 0 to 10.
        period: Sampling time T [s].
        age: Age of measured velocities [s], 0 to T.

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
        self._n, self._advance_function = n, _advance_function(robot, ticks, period, age)
        # torques that hold the links at rest
        self._weight = ca.Function(
            "weight",
            [self._advance_function.sx_in(0)],
            [bias_torque(robot, self._advance_function.sx_in(0)[:n], ca.SX(n, 1))],
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
        """Return the initial states; omitted ones are zero."""
        return {"sent": ca.repmat(self._weight(u.joint_state), self._ticks + 1, 1)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        predicted = self._advance_function(u.joint_state, x.sent)
        return {"joint_state": where(is_finite(predicted), predicted, u.joint_state)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        net = u.drive_torque
        if u.friction_torque is not None:
            net = net - u.friction_torque
        return {"sent": ca.vertcat(x.sent[self._n :], net)}
