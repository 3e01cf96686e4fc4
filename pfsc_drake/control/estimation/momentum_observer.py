"""What acts on a robot besides what is known, from how its momentum changes."""

import casadi as ca

from pfsc_drake.control.estimation.generalized_momentum import MomentumModel
from pfsc_drake.control.estimation.sampled_estimator import SampledEstimator
from pfsc_drake.control.estimation.signal_derivatives import SignalDerivatives


class MomentumObserver(SampledEstimator):
    """Observer of the unknown torque z in ``p' = f + tau + sign z``, sampled.

    The drives hold their torque over an interval, so that between two samples z was on
    average::

        z_mean = sign ((p_k - p_{k-1}) / T - (f_k + f_{k-1}) / 2 - tau_{k-1})

    with ``tau = drive_weight tau_d + known_weight tau_k``; where velocities are measured with a
    delay, tau is the mean over an interval that much earlier. The estimate follows it as
    :class:`SignalDerivatives` does; without derivatives that is the disturbance observer of
    first order with rate L, ``z_hat' = L (z - z_hat)``, exactly discretized::

        z_hat_k = z_hat_{k-1} + (1 - exp(-L T)) (z_mean - z_hat_{k-1})

    The estimate is z and its derivatives by rows [Nm or N, per s, per s^2], shape
    ((num_derivatives + 1) N,). A memory of zeros is that of an observer that has seen nothing:
    the first estimate is zero.

    Args:
        model: Momenta and forces; their delay is at most T.
        rate: L [1/s].
        period: Sampling time T [s].
        num_derivatives: Number of derivatives of the estimate, 0 to 2.

    Raises:
        InputError: If rate or number of derivatives are out of range.
    """

    def __init__(
        self, model: MomentumModel, rate: float, period: float, num_derivatives: int = 0
    ) -> None:
        super().__init__(_observer_function(model, rate, period, num_derivatives), model.dimension)


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
