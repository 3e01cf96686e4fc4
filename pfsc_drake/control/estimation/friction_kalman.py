"""Coefficients of friction from how the joints move: the Kalman filter of App. A."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from pfsc_drake.control.checks import checked_vector
from pfsc_drake.control.estimation.friction_model import friction_torque, require_smoothing
from pfsc_drake.control.estimation.generalized_momentum import MomentumModel
from pfsc_drake.control.estimation.sampled_estimator import SampledEstimator
from pfsc_drake.errors import InputError

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


class FrictionKalmanFilter(SampledEstimator):
    """Linear time-varying Kalman filter of ``x_i = [p_i, f_c,i, f_v,i]`` for each axis (A.5).

    Between two samples at times ``t_{k-1}`` and ``t_k = t_{k-1} + T`` the model is::

        p_k = p_{k-1} - s f_c - w f_v + T u,   f_c, f_v constant,   p measured

    With ``intervals: begin``, as printed, velocity and forces are held over the interval:
    ``s = T sign(v_{k-1})``, ``w = T v_{k-1}``, ``u = tau_{k-1} + f_{k-1}``. They change in it,
    which leaves f_v off by up to a tenth. With ``mean`` they enter by their means::

        w = q_k - q_{k-1},  s = T (|v_k| - |v_{k-1}|) / (v_k - v_{k-1}),
        u = tau_{k-1} + (f_k + f_{k-1}) / 2

    (s for a velocity that goes evenly from one value to the other), and an axis at rest, below a
    velocity, is left alone: a drive that sticks tells nothing about its coefficients. Velocities
    and positions are those that friction acts on, of the motors. Where velocities are measured
    with a delay, all is taken that much earlier.

    Args:
        model: Momenta and forces, of :func:`drive_momentum`; their delay is at most T.
        start: First estimates of f_c and f_v, shape (2, N).
        noise: The covariances.
        period: Sampling time T [s].
        intervals: ``mean`` or ``begin``.
        resting_velocity: Below which an axis is at rest [rad/s or m/s], for ``mean``.
        smoothing: See :func:`friction_torque`.

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
        resting = resting_velocity if intervals == "mean" else -1.0
        super().__init__(
            _filter_function(model, noise, period, intervals == "mean", resting, smoothing), n
        )
        self._velocity = self.arguments["velocity"]
        self.initial_memory[n : 3 * n] = first.ravel()
        # variances of f_c and f_v
        for block in (6, 8):
            self.initial_memory[block * n : (block + 1) * n] = noise.initial

    def estimate(
        self, memory: np.ndarray, state: np.ndarray, velocity: np.ndarray | None = None
    ) -> np.ndarray:
        """Return friction torque [Nm or N], f_c and f_v at a sample, shape (3N,).

        Args:
            memory: From the last sample, as :attr:`initial_memory`.
            state: ``[q_J, v_J, q_M, v_M]`` at this sample, shape (4N,).
            velocity: For which the torque is wanted, shape (N,); the motors' if omitted.

        Returns:
            A view that the next evaluation overwrites.
        """
        self._velocity[:] = state[3 * self.num_joints :] if velocity is None else velocity
        return super().estimate(memory, state)


def _filter_function(
    model: MomentumModel,
    noise: FrictionNoise,
    period: float,
    mean: bool,
    resting: float,
    smoothing: float,
) -> ca.Function:
    """Return one step of the filter, all axes at once, elementwise.

    ``(memory, state, velocity, drive_torque, known_torque) -> (estimate, next memory, check)``;
    the check is finite only if the next memory is. Memory: p, f_c, f_v; the entries pp, pc, pv,
    cc, cv, vv of P; position, velocity, forces and torques of the last sample, and the torques
    of the one before; whether there was one.
    """
    n = model.dimension
    memory, velocity = ca.SX.sym("memory", 14 * n + 1), ca.SX.sym("velocity", n)
    drive, known = ca.SX.sym("drive_torque", n), ca.SX.sym("known_torque", n)
    p, f_c, f_v, pp, pc, pv, cc, cv, vv, q_0, v_0, forces_0, last, before = ca.vertsplit(
        memory[:-1], n
    )
    acting = last + model.delay / period * (before - last)
    q, v = ca.vertsplit(model.state, n)[2:]
    q = q - model.delay * v
    if mean:
        turns = v * v_0 < 0.0
        share = (ca.fabs(v) - ca.fabs(v_0)) / ca.if_else(turns, v - v_0, 1.0)
        s = period * ca.if_else(turns, share, ca.sign(v + v_0))
        w = q - q_0
        u = acting + (model.forces + forces_0) / 2.0
    else:
        s, w, u = period * ca.sign(v_0), period * v_0, acting + forces_0
    # prediction: Phi P Phi^T + Q with Phi = [[1, -s, -w], [0, 1, 0], [0, 0, 1]]
    Q_p, Q_c, Q_v, R = (
        ca.DM(x) for x in (noise.momentum, noise.coulomb, noise.viscous, noise.measurement)
    )
    pc_1, pv_1 = pc - s * cc - w * cv, pv - s * cv - w * vv
    pp_1 = pp - s * (pc + pc_1) - w * (pv + pv_1) + Q_p
    cc_1, vv_1 = cc + Q_c, vv + Q_v
    # correction
    innovation = model.momentum - (p - s * f_c - w * f_v + period * u)
    gain = [x / (pp_1 + R) for x in (pp_1, pc_1, pv_1)]
    corrected = [
        p - s * f_c - w * f_v + period * u + gain[0] * innovation,
        f_c + gain[1] * innovation,
        f_v + gain[2] * innovation,
        pp_1 - gain[0] * pp_1,
        pc_1 - gain[0] * pc_1,
        pv_1 - gain[0] * pv_1,
        cc_1 - gain[1] * pc_1,
        cv - gain[1] * pv_1,
        vv_1 - gain[2] * pv_1,
    ]
    # nothing is learned from an interval at rest, or whose begin is unknown
    anew = [model.momentum, f_c, f_v, ca.SX(R), ca.SX(n, 1), ca.SX(n, 1), cc, cv, vv]
    learns = ca.logic_and(memory[-1] > 0.0, ca.fmin(ca.fabs(v), ca.fabs(v_0)) > resting)
    filtered = [ca.if_else(learns, a, b) for a, b in zip(corrected, anew, strict=True)]
    told = ca.DM(model.drive_weight) * drive + ca.DM(model.known_weight) * known
    following = ca.vertcat(*filtered, q, v, model.forces, told, last, 1.0)
    torque = friction_torque(filtered[1], filtered[2], velocity, smoothing)
    results = [ca.vertcat(torque, *filtered[1:3]), following, ca.sum1(following)]
    return ca.Function(
        "friction_kalman_filter",
        [memory, model.state, velocity, drive, known],
        ca.cse([ca.densify(result) for result in results]),
        ["memory", "state", "velocity", "drive_torque", "known_torque"],
        ["estimate", "next", "check"],
    )
