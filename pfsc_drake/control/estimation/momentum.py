"""Generalized momenta and their observers, which need no accelerations.

The momentum of a robot's links ``p = D_E(q) q'`` obeys ``p' = tau + beta``, with all torques
``tau`` that act on the links, and ``beta = C^T(q, q') q' - g(q)``, the gradient of the
kinetic less the potential energy (A. De Luca, R. Mattone, ICRA 2003; App. A). Its rate needs
no acceleration, and a difference of momenta is the impulse of all torques in between.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import hold_if_not_finite, where
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.estimation.filters import SignalDerivatives
from pfsc_drake.robot.robot_model import MAY_BE_PARAMETRIC, RobotModel, gravity_torque

SMOOTH = 0.01  # rad/s or m/s, within which Coulomb friction changes its sign


@dataclass(frozen=True)
class MomentumModel:
    """One momentum per joint, and the torques that change it.

    ``p' = f + drive_weight tau_d + known_weight tau_k + sign z``: the forces f follow from the
    state, ``tau_d`` are the commanded drive torques, ``tau_k`` other known torques, and z the
    unknown torque.

    Attributes:
        state: Symbol ``[q_J, v_J, q_M, v_M]``, shape (4N, 1).
        momentum: p as an expression of the state, shape (N, 1) [Nm s or N s].
        forces: f as an expression of the state, shape (N, 1) [Nm or N].
        drive_weight: Weight of each drive torque, 1 or 0, shape (N,).
        known_weight: Weight of each known torque, shape (N,).
        sign: 1 or -1.
        delay: Age of the velocities when they are measured [s].
    """

    state: ca.SX
    momentum: ca.SX
    forces: ca.SX
    drive_weight: np.ndarray
    known_weight: np.ndarray
    sign: float
    delay: float = 0.0

    @property
    def dimension(self) -> int:
        """Number of joints N."""
        return self.momentum.numel()

    def with_delay(self, delay: float) -> "MomentumModel":
        """Return the momenta of a state whose velocities are older than its positions.

        A difference quotient is the velocity half an interval ago. To evaluate all quantities at
        the same time, positions are shifted back, ``q - delay q'``; the torques must be shifted by
        the same time.

        Args:
            delay: Age of the velocities [s].
        """
        q_J, v_J, q_M, v_M = ca.vertsplit(self.state, self.dimension)
        then = ca.vertcat(q_J - delay * v_J, v_J, q_M - delay * v_M, v_M)
        momentum, forces = ca.substitute([self.momentum, self.forces], [self.state], [then])
        return replace(self, momentum=momentum, forces=forces, delay=delay)

    def known_torques(self, drive_torque: Any, known_torque: Any | None) -> Any:
        """Return the known torques that change the momenta, shape (N, 1).

        Args:
            drive_torque: Commanded drive torques, shape (N, 1).
            known_torque: Other known torques, shape (N, 1); None for none.
        """
        acting = ca.DM(self.drive_weight) * drive_torque
        return acting if known_torque is None else acting + ca.DM(self.known_weight) * known_torque

    def mean_torque(self, acting: Any, acted: Any, period: float) -> Any:
        """Return the mean torques over an interval that is delayed like the velocities, (N, 1).

        Args:
            acting: Torques since the last sample, shape (N, 1).
            acted: Torques in the interval before, shape (N, 1).
            period: Sampling time [s].
        """
        return acting + self.delay / period * (acted - acting)

    def __content__(self) -> object:
        """Return the data that determine it."""
        return self.function, self.drive_weight, self.known_weight, self.sign, self.delay

    @cached_property
    def function(self) -> ca.Function:
        """``state -> (p, f)``, shapes (4N,), (N,), (N,)."""
        return ca.Function(
            "momentum",
            [self.state],
            ca.cse([ca.densify(self.momentum), ca.densify(self.forces)]),
            ["state"],
            ["momentum", "forces"],
            MAY_BE_PARAMETRIC,
        )


@once_per_content()
def drive_momentum(robot: RobotModel) -> MomentumModel:
    """Return the momenta on which friction of the drives acts; z is the friction torque.

    Elastic joint: momentum of the motor, ``p = D_M v_M``, ``p' = tau_d - tau_J - tau_f``, (2.65b).
    Forces on the tool enter only by the joint torque
    ``tau_J = K_s (q_M - q_J) + K_d (v_M - v_J)``, which is measured. Rigid joint: momentum of the
    arm and the rotor, ``p = D_E v_J + D_M v_M``, ``p' = tau_d + beta + tau_ext - tau_f``. External
    forces are taken for friction unless they are known, ``tau_k = tau_ext``. The damping of the
    joints' bearings is known.

    Args:
        robot: The robot; any of its N joints may be elastic.
    """
    elastic, state = robot.elastic_joints, ca.SX.sym("state", 4 * robot.dimension)
    v_M = ca.vertsplit(state, robot.dimension)[3]
    momentum, forces = robot.D_M * v_M, -ca.DM(robot.viscous_damping) * v_M
    p_E, beta = _links(robot, state)
    rigid = ca.DM(~elastic)
    return MomentumModel(
        state,
        momentum + rigid * p_E,
        forces + rigid * beta - _joint_torque(robot, state),
        np.ones(robot.dimension),
        1.0 - elastic,
        -1.0,
    )


@once_per_content()
def link_momentum(robot: RobotModel) -> MomentumModel:
    """Return the momenta on which forces on the tool act; z is the external torque.

    Elastic joint: ``p = D_E v_J``, ``p' = tau_J + beta + tau_ext`` (2.65a), independent of the
    friction of the drives. Rigid joint: ``p = D_E v_J + D_M v_M``,
    ``p' = tau_d + beta + tau_ext - tau_f``. Friction is taken for an external force unless it is
    known, ``tau_k = tau_f``.

    Args:
        robot: The robot; any of its N joints may be elastic.
    """
    rigid, state = ~robot.elastic_joints, ca.SX.sym("state", 4 * robot.dimension)
    v_M = ca.vertsplit(state, robot.dimension)[3]
    p_E, beta = _links(robot, state)
    rotors = ca.DM(1.0 * rigid) * robot.D_M * v_M
    damping = ca.DM(rigid * robot.viscous_damping) * v_M
    return MomentumModel(
        state,
        p_E + rotors,
        beta + _joint_torque(robot, state) - damping,
        1.0 * rigid,
        -1.0 * rigid,
        1.0,
    )


@once_per_content()
def motor_momentum(robot: RobotModel, friction: tuple[np.ndarray, np.ndarray]) -> MomentumModel:
    """Return the momenta of the motors alone; z is the torque of the springs behind them.

    ``p = D_M v_M``, ``p' = tau_d - f_c tanh(v_M / w) - f_v v_M - z``, independent of the links.
    Unmodelled friction is taken for a torque of the springs. A torque ``tau_k`` is subtracted from
    z.

    Args:
        robot: The robot, N joints; z of rigid ones is meaningless.
        friction: Nominal coefficients f_c and f_v, each (N,).
    """
    n, (f_c, f_v) = robot.dimension, friction
    state = ca.SX.sym("state", 4 * n)
    v_M = ca.vertsplit(state, n)[3]
    rubbing = ca.DM(f_c) * ca.tanh(v_M / SMOOTH) + ca.DM(f_v) * v_M
    forces = -ca.DM(robot.viscous_damping) * v_M - rubbing
    return MomentumModel(state, robot.D_M * v_M, forces, np.ones(n), -np.ones(n), -1.0)


def _links(robot: RobotModel, state: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return the links' momentum ``D_E q'`` and ``beta``, each (N, 1)."""
    q, v = ca.vertsplit(state, robot.dimension)[:2]
    position = ca.SX.sym("position", robot.dimension)
    momentum = robot.mass_matrix(position) @ v
    rate = ca.gradient(ca.dot(v, momentum) / 2.0, position) - gravity_torque(robot, position)
    return tuple(ca.substitute([momentum, rate], [position], [q]))


def _joint_torque(robot: RobotModel, state: ca.SX) -> ca.SX:
    """Return ``tau_J`` (2.66) of the elastic joints, zero for the rigid ones, (N, 1)."""
    q_J, v_J, q_M, v_M = ca.vertsplit(state, robot.dimension)
    K_s, K_d = ca.sparsify(robot.springs), ca.DM(np.where(robot.elastic_joints, robot.K_d, 0.0))
    K_d = ca.sparsify(K_d)
    return K_s * (q_M - q_J) + K_d * (v_M - v_J)


class MomentumObserver(Block):
    """Observer of the unknown torque z in ``p' = f + tau + sign z``, sampled.

    With the momenta of :func:`~pfsc_drake.control.estimation.momentum.drive_momentum`
    it estimates the friction of the drives, with those of ``link_momentum`` the external torques.

    The drives hold their torque over an interval. The mean of z between two samples is::

        z_mean = sign ((p_k - p_{k-1}) / T - (f_k + f_{k-1}) / 2 - tau_{k-1})

    with ``tau = drive_weight tau_d + known_weight tau_k``; where velocities are measured with a
    delay, tau is the mean over an interval that is earlier by this delay. The estimate follows z as
    in :class:`SignalDerivatives`; without derivatives this is the disturbance observer of first
    order with rate L, ``z_hat' = L (z - z_hat)``, exactly discretized::

        z_hat_k = z_hat_{k-1} + (1 - exp(-L T)) (z_mean - z_hat_{k-1})

    The first estimate is zero. After a NaN or infinite sample it is constant, and the next sample
    starts a new interval.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        drive_torque (input): Commanded drive torques until the next tick, within their limits
            [Nm or N], shape (N,).
        known_torque (input, optional): Other known torques that act until then, see
            :class:`~pfsc_drake.control.estimation.momentum.MomentumModel`, shape
            (N,) [Nm or N]; zero if not connected.
        estimate (output): z and its derivatives by rows, shape ((num_derivatives + 1) N,)
            [Nm or N, per s, per s^2]. The drive torques may depend on it.

    State:
        estimate (predicted for this tick), momentum and forces of the last tick, torques that act
        since then (``acting``) and before (``acted``); whether there was a sample (``seen``).

    Args:
        model: Momenta and forces of N joints; their delay is at most T.
        rate: L [1/s].
        period: Sampling time T [s].
        num_derivatives: Number of derivatives of the estimate, 0 to 2.

    Raises:
        InputError: If rate or number of derivatives are out of range.
    """

    def __init__(
        self, model: MomentumModel, rate: float, period: float, num_derivatives: int = 0
    ) -> None:
        n, values = model.dimension, (num_derivatives + 1) * model.dimension
        self._filter = SignalDerivatives(num_derivatives, rate, period)
        self._model, self._period = model, period
        self._momentum = model.function
        self.inputs = {
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "drive_torque": Port(n, "Nm or N"),
            "known_torque": Port(n, "Nm or N", optional=True),
        }
        self.outputs = {"estimate": Port(values, "Nm or N, per s, per s^2")}
        of_joints = ("momentum", "forces", "acting", "acted")
        self.states = {"estimate": values} | dict.fromkeys(of_joints, n) | {"seen": 1}
        self.inner = {"momentum": n, "forces": n}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        model, T = self._model, self._period
        p, f = self._momentum(u.joint_state)
        tau = model.mean_torque(x.acting, x.acted, T)
        z_mean = model.sign * ((p - x.momentum) / T - (f + x.forces) / 2.0 - tau)
        predicted = x.estimate[: model.dimension]
        sample = where(x.seen > 0.0, z_mean, predicted)
        estimate = self._filter.estimate(x.estimate, sample)
        return {"estimate": estimate, "momentum": p, "forces": f}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        sampled = {
            "estimate": self._filter.predict(y.estimate),
            "momentum": y.momentum,
            "forces": y.forces,
            "acting": self._model.known_torques(u.drive_torque, u.known_torque),
            "acted": x.acting,
        }
        states, good = hold_if_not_finite(sampled, x)
        return states | {"seen": good}
