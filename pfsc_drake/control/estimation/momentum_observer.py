"""What acts on a robot besides what is known, from how its momentum changes."""

import math

import casadi as ca
import numpy as np

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.estimation.generalized_momentum import MomentumModel
from pfsc_drake.control.estimation.signal_derivatives import SignalDerivatives


class MomentumObserver:
    """Observer of the unknown torque z in ``p' = f + tau + sign z``, sampled.

    The drives hold their torque over an interval, so that between two samples z was on
    average::

        z_mean = sign ((p_k - p_{k-1}) / T - (f_k + f_{k-1}) / 2 - tau_{k-1})

    with ``tau = drive_weight tau_d + known_weight tau_k``; where velocities are measured with a
    delay, tau is the mean over an interval that much earlier. The estimate follows it as
    :class:`SignalDerivatives` does; without derivatives that is the disturbance observer of
    first order with rate L, ``z_hat' = L (z - z_hat)``, exactly discretized::

        z_hat_k = z_hat_{k-1} + (1 - exp(-L T)) (z_mean - z_hat_{k-1})

    Memory is one array, which :meth:`estimate` reads and :meth:`remember` writes; zeros are
    that of an observer that has seen nothing: the first estimate is zero.

    Args:
        model: Momenta and forces; their delay is at most T.
        rate: L [1/s].
        period: Sampling time T [s].
        num_derivatives: Number of derivatives of the estimate, 0 to 2.

    Attributes:
        num_joints: N.
        num_values: Length of the estimate, ``(num_derivatives + 1) N``.
        memory_size: Length of the memory.

    Raises:
        InputError: If rate or number of derivatives are out of range.
    """

    def __init__(
        self, model: MomentumModel, rate: float, period: float, num_derivatives: int = 0
    ) -> None:
        n = model.dimension
        function = BoundFunction(_observer_function(model, rate, period, num_derivatives))
        arguments, results = function.arguments, function.results
        self._state, self._memory = arguments["state"], arguments["memory"]
        self._drive, self._known = arguments["drive_torque"], arguments["known_torque"]
        self._estimate, self._next = results["estimate"], results["next"]
        self._check, self._evaluate = results["check"], function.evaluate
        self.num_joints, self.num_values = n, len(self._estimate)
        self.memory_size = len(self._memory)

    def estimate(self, memory: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return z and its derivatives at a sample by rows, shape ((num_derivatives + 1) N,).

        Args:
            memory: From the last sample, shape (memory_size,).
            state: ``[q_J, v_J, q_M, v_M]`` at this sample, shape (4N,).

        Returns:
            A view that the next evaluation overwrites [Nm or N, per s, per s^2].
        """
        self._memory[:] = memory
        self._state[:] = state
        self._evaluate()
        return self._estimate

    def remember(
        self,
        memory: np.ndarray,
        state: np.ndarray,
        drive_torque: np.ndarray,
        known_torque: np.ndarray | None = None,
    ) -> None:
        """Overwrite the memory by that of this sample.

        After a sample that is not finite the estimate stands still, and the next sample starts
        a new interval.

        Args:
            memory: From the last sample, shape (memory_size,).
            state: ``[q_J, v_J, q_M, v_M]`` at this sample, shape (4N,).
            drive_torque: What the drives do until the next sample, shape (N,).
            known_torque: ``tau_k`` until then, shape (N,); zero if omitted.
        """
        self._drive[:] = drive_torque
        self._known[:] = 0.0 if known_torque is None else known_torque
        self.estimate(memory, state)
        if math.isfinite(self._check[0]):
            memory[:] = self._next
        else:
            memory[-1] = 0.0


def _observer_function(
    model: MomentumModel, rate: float, period: float, num_derivatives: int
) -> ca.Function:
    """Return ``(memory, state, drive_torque, known_torque) -> (estimate, next memory, check)``.

    The check is finite only if the next memory is: a sum is finite only if all its terms are.
    """
    n, rows = model.dimension, num_derivatives + 1
    filter_ = SignalDerivatives(num_derivatives, rate, period)
    memory = ca.SX.sym("memory", (rows + 4) * n + 1)
    drive, known = ca.SX.sym("drive_torque", n), ca.SX.sym("known_torque", n)
    predicted = ca.reshape(memory[: rows * n], n, rows)
    p, f, last, before = ca.vertsplit(memory[rows * n : -1], n)
    acting = last + model.delay / period * (before - last)
    change = (model.momentum - p) / period
    mean = model.sign * (change - (model.forces + f) / 2.0 - acting)
    innovation = ca.if_else(memory[-1] > 0.0, mean - predicted[:, 0], 0.0)
    estimate = predicted + innovation @ ca.DM(filter_.gain).T
    following = ca.vertcat(
        ca.vec(estimate @ ca.DM(filter_.transition).T),
        model.momentum,
        model.forces,
        ca.DM(model.drive_weight) * drive + ca.DM(model.known_weight) * known,
        last,
        1.0,
    )
    results = [ca.vec(estimate), following, ca.sum1(following)]
    return ca.Function(
        "momentum_observer",
        [memory, model.state, drive, known],
        ca.cse([ca.densify(result) for result in results]),
        ["memory", "state", "drive_torque", "known_torque"],
        ["estimate", "next", "check"],
    )
