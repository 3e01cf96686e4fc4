"""Joint friction: model with known coefficients, and the Kalman filter of App. A."""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import hold_if_not_finite, where
from pfsc_drake.checks import checked_vector
from pfsc_drake.control.estimation.momentum import MomentumModel
from pfsc_drake.errors import InputError


def friction_torque(coulomb: Any, viscous: Any, velocity: Any, smoothing: float) -> Any:
    """Return ``tau_f = f_c tanh(v / v_s) + f_v v``, shape (N, 1) [Nm or N].

    This is (2.41) with a smooth step: a torque that jumps with the sign of a measured velocity
    causes chattering of drives at rest.

    Args:
        coulomb: ``f_c``, shape (N, 1) [Nm or N].
        viscous: ``f_v``, shape (N, 1) [Nm s/rad or N s/m].
        velocity: v of the drives, shape (N, 1) [rad/s or m/s].
        smoothing: ``v_s`` [rad/s or m/s].
    """
    return coulomb * ca.tanh(velocity / smoothing) + viscous * velocity


def require_smoothing(smoothing: float) -> None:
    """Require a positive velocity of smoothing.

    Raises:
        InputError: If it is not positive.
    """
    if not 0.0 < smoothing < np.inf:
        raise InputError(f"smoothing = {smoothing}: must be a positive number")


class FrictionModel(Block):
    """Friction model with known coefficients, see :func:`friction_torque`.

    Ports:
        velocity (input): v of the drives [rad/s or m/s]; its last N entries if there are more,
            as in ``[q_J, v_J, q_M, v_M]``.
        friction_torque (output): ``tau_f`` [Nm or N], shape (N,).

    Args:
        coulomb: ``f_c``, shape (N,) [Nm or N], none negative.
        viscous: ``f_v``, shape (N,) [Nm s/rad or N s/m], none negative.
        smoothing: ``v_s`` [rad/s or m/s], positive.
        size: Length of the input port, N or more; N if omitted.

    Raises:
        InputError: If a number is out of range.
    """

    def __init__(
        self, coulomb: np.ndarray, viscous: np.ndarray, smoothing: float, size: int | None = None
    ) -> None:
        n = np.size(coulomb)
        self._f_c, self._f_v = (
            ca.DM(checked_vector("friction model", name, values, n, positive=False))
            for name, values in (("coulomb", coulomb), ("viscous", viscous))
        )
        require_smoothing(smoothing)
        self._smoothing = smoothing
        self.inputs = {"velocity": Port(n if size is None else size, "rad/s or m/s")}
        self.outputs, self.states = {"friction_torque": Port(n, "Nm or N")}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        v = u.velocity[-self._f_c.numel() :]
        return {"friction_torque": friction_torque(self._f_c, self._f_v, v, self._smoothing)}


INTERVALS = ("mean", "begin")


@dataclass(frozen=True, eq=False)
class FrictionNoise:
    """Covariances of the filter, diagonal, each of shape (N,) and per sample.

    Attributes:
        momentum: Q of the momentum [(Nm s)^2].
        coulomb: Q of f_c [Nm^2].
        viscous: Q of f_v [(Nm s/rad)^2].
        measurement: R of the measured momentum [(Nm s)^2], positive.
        initial: P_0 of f_c and f_v, of all joints alike.

    Raises:
        InputError: If a number is out of range, or the shapes differ.
    """

    momentum: np.ndarray
    coulomb: np.ndarray
    viscous: np.ndarray
    measurement: np.ndarray
    initial: float

    def __post_init__(self) -> None:
        size = np.size(self.momentum)
        for name in ("momentum", "coulomb", "viscous", "measurement"):
            values = checked_vector(
                "noise", name, getattr(self, name), size, positive=name == "measurement"
            )
            object.__setattr__(self, name, values)
        if not 0.0 <= self.initial < np.inf:
            raise InputError(f"noise: initial = {self.initial}; must be zero or positive, finite")


class FrictionKalmanFilter(Block):
    """Linear time-varying Kalman filter of ``x_i = [p_i, f_c,i, f_v,i]`` for each axis (A.5).

    Between two samples at times ``t_{k-1}`` and ``t_k = t_{k-1} + T`` the model is::

        p_k = p_{k-1} - s f_c - w f_v + T u,   f_c, f_v constant,   p measured

    With ``intervals: begin``, as printed, velocity and forces are constant over the interval:
    ``s = T sign(v_{k-1})``, ``w = T v_{k-1}``, ``u = tau_{k-1} + f_{k-1}``. Their change within the
    interval causes an error of f_v of up to a tenth. With ``mean`` they enter by their means::

        w = q_k - q_{k-1},  s = T (|v_k| - |v_{k-1}|) / (v_k - v_{k-1}),
        u = tau_{k-1} + (f_k + f_{k-1}) / 2

    (s for a velocity that changes linearly), and an axis at rest, below a threshold velocity, is
    not updated: a drive that sticks contains no information about its coefficients. Velocities and
    positions are those of the motors, on which friction acts. Where velocities are measured with a
    delay, all quantities are evaluated at that earlier time. After a NaN or infinite sample the
    estimate is constant, and the next sample starts a new interval.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        drive_torque (input): Commanded drive torques until the next tick, within their limits
            [Nm or N], shape (N,).
        known_torque (input, optional): Other known torques that act until then, see
            :class:`~pfsc_drake.control.estimation.momentum.MomentumModel`, shape
            (N,); zero if not connected.
        velocity (input, optional): Velocity at which the friction torque is evaluated
            [rad/s or m/s], shape (N,); the motors' measured one if not connected.
        estimate (output): ``[tau_f, f_c, f_v]``, shape (3N,). The drive torques may depend on it.
        friction_torque (output): ``tau_f`` alone, shape (N,).

    State:
        estimate (``[p, f_c, f_v]`` at the last tick), covariance (entries pp, pc, pv, cc, cv, vv
        of P, each (N,)); position, velocity and forces of that tick, torques that act since then
        (``acting``) and before (``acted``); whether there was a sample (``seen``).

    Args:
        model: Momenta and forces, of :func:`drive_momentum`; their delay is at most T.
        start: First estimates of f_c and f_v, shape (2, N).
        noise: The covariances.
        period: Sampling time T [s].
        intervals: ``mean`` or ``begin``.
        resting_velocity: Below which an axis is at rest [rad/s or m/s], for ``mean``.
        smoothing: Speed within which friction is smooth [rad/s or m/s].

    Raises:
        InputError: If a number is out of range.
    """

    def __init__(
        self,
        model: MomentumModel,
        start: np.ndarray,
        noise: FrictionNoise,
        period: float,
        *,
        intervals: str = "mean",
        resting_velocity: float = 0.0,
        smoothing: float = 0.02,
    ) -> None:
        n = model.dimension
        first = np.asarray(start, dtype=float)
        if first.shape != (2, n) or not np.isfinite(first).all():
            raise InputError(f"first estimates of friction: {start}; must be 2 times {n} numbers")
        if noise.momentum.size != n:
            raise InputError(f"noise: of {noise.momentum.size} joints; the robot has {n}")
        if intervals not in INTERVALS:
            raise InputError(f"intervals = {intervals!r}: must be one of {', '.join(INTERVALS)}")
        if not 0.0 <= resting_velocity < np.inf:
            raise InputError(f"resting_velocity = {resting_velocity}: must be zero or positive")
        require_smoothing(smoothing)
        self._model, self._period, self._momentum = model, period, model.function
        self._first, self._noise, self._smoothing = ca.DM(first.ravel()), noise, smoothing
        self._mean = intervals == "mean"
        self._resting = resting_velocity if self._mean else -1.0
        self.inputs = {
            "joint_state": Port(4 * n, "rad, rad/s or m, m/s"),
            "drive_torque": Port(n, "Nm or N"),
            "known_torque": Port(n, "Nm or N", optional=True),
            "velocity": Port(n, "rad/s or m/s", optional=True),
        }
        self.outputs = {
            "estimate": Port(3 * n, "Nm or N, Nm s/rad or N s/m"),
            "friction_torque": Port(n, "Nm or N"),
        }
        filtered, last = {"estimate": 3 * n, "covariance": 6 * n}, ("position", "velocity")
        sampled = dict.fromkeys((*last, "forces"), n)
        self.states = filtered | sampled | {"acting": n, "acted": n, "seen": 1}
        self.inner = {"corrected": 3 * n, "covariance": 6 * n} | sampled

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        zero, one = ca.DM.zeros(self._model.dimension), ca.DM.ones(self._model.dimension)
        P_0 = self._noise.initial
        return {
            "estimate": ca.vertcat(zero, self._first),
            "covariance": ca.vertcat(zero, zero, zero, P_0 * one, zero, P_0 * one),
        }

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        momentum, forces = self._momentum(u.joint_state)
        n, delay = self._model.dimension, self._model.delay
        q_M, v = ca.vertsplit(u.joint_state, n)[2:]
        q = q_M - delay * v
        found, P = self._filter_step(x, momentum, forces, q, v)
        velocity = v if u.velocity is None else u.velocity
        torque = friction_torque(found[1], found[2], velocity, self._smoothing)
        return {
            "estimate": ca.vertcat(torque, *found[1:]),
            "friction_torque": torque,
            "corrected": ca.vertcat(*found),
            "covariance": ca.vertcat(*P),
            "position": q,
            "velocity": v,
            "forces": forces,
        }

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        sampled = {
            "estimate": y.corrected,
            "covariance": y.covariance,
            "position": y.position,
            "velocity": y.velocity,
            "forces": y.forces,
            "acting": self._model.known_torques(u.drive_torque, u.known_torque),
            "acted": x.acting,
        }
        states, good = hold_if_not_finite(sampled, x)
        return states | {"seen": good}

    def _filter_step(
        self, x: Values, momentum: Any, forces: Any, q: Any, v: Any
    ) -> tuple[list[Any], list[Any]]:
        """Return p, f_c, f_v, and the entries of P after a sample, for all axes."""
        T, model, noise = self._period, self._model, self._noise
        p, f_c, f_v = ca.vertsplit(x.estimate, model.dimension)
        pp, pc, pv, cc, cv, vv = ca.vertsplit(x.covariance, model.dimension)
        tau = model.mean_torque(x.acting, x.acted, T)
        v_0 = x.velocity
        if self._mean:
            turns = v * v_0 < 0.0
            share = (ca.fabs(v) - ca.fabs(v_0)) / where(turns, v - v_0, 1.0)
            s, w = T * where(turns, share, ca.sign(v + v_0)), q - x.position
            forces = (forces + x.forces) / 2.0
        else:
            s, w, forces = T * ca.sign(v_0), T * v_0, x.forces
        # prediction: Phi P Phi^T + Q with Phi = [[1, -s, -w], [0, 1, 0], [0, 0, 1]]
        Q_p, Q_c, Q_v, R = (
            ca.DM(value)
            for value in (noise.momentum, noise.coulomb, noise.viscous, noise.measurement)
        )
        predicted = p - s * f_c - w * f_v + T * (tau + forces)
        pc_1, pv_1 = pc - s * cc - w * cv, pv - s * cv - w * vv
        pp_1 = pp - s * (pc + pc_1) - w * (pv + pv_1) + Q_p
        cc_1, vv_1 = cc + Q_c, vv + Q_v
        # correction
        innovation = momentum - predicted
        gain = [value / (pp_1 + R) for value in (pp_1, pc_1, pv_1)]
        estimate = [
            predicted + gain[0] * innovation,
            f_c + gain[1] * innovation,
            f_v + gain[2] * innovation,
        ]
        P = [
            pp_1 - gain[0] * pp_1,
            pc_1 - gain[0] * pc_1,
            pv_1 - gain[0] * pv_1,
            cc_1 - gain[1] * pc_1,
            cv - gain[1] * pv_1,
            vv_1 - gain[2] * pv_1,
        ]
        # no correction in an interval at rest, or whose begin is unknown
        moves = ca.fmin(ca.fabs(v), ca.fabs(v_0)) > self._resting
        learns = ca.logic_and(x.seen > 0.0, moves)
        anew = [momentum, f_c, f_v], [R, 0.0, 0.0, cc, cv, vv]
        return (
            [where(learns, a, b) for a, b in zip(estimate, anew[0], strict=True)],
            [where(learns, a, b) for a, b in zip(P, anew[1], strict=True)],
        )
