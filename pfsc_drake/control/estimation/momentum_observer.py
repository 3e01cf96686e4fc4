"""What acts on a robot besides what is known, from how its momentum changes."""

from typing import Any

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import kept_if_finite, where
from pfsc_drake.control.estimation.generalized_momentum import MomentumModel
from pfsc_drake.control.estimation.signal_derivatives import SignalDerivatives


class MomentumObserver(Block):
    """Observer of the unknown torque z in ``p' = f + tau + sign z``, sampled.

    With the momenta of :func:`~pfsc_drake.control.estimation.generalized_momentum.drive_momentum`
    it finds the friction of the drives, with those of ``link_momentum`` the external torques.

    The drives hold their torque over an interval, so that between two samples z was on
    average::

        z_mean = sign ((p_k - p_{k-1}) / T - (f_k + f_{k-1}) / 2 - tau_{k-1})

    with ``tau = drive_weight tau_d + known_weight tau_k``; where velocities are measured with a
    delay, tau is the mean over an interval that much earlier. The estimate follows it as
    :class:`SignalDerivatives` does; without derivatives that is the disturbance observer of
    first order with rate L, ``z_hat' = L (z - z_hat)``, exactly discretized::

        z_hat_k = z_hat_{k-1} + (1 - exp(-L T)) (z_mean - z_hat_{k-1})

    The first estimate is zero. After a sample that is not finite it stands still, and the next
    sample starts a new interval.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        drive_torque (input): What the drives are told until the next tick, within their limits
            [Nm or N], shape (N,).
        known_torque (input, optional): What else is known to act until then, see
            :class:`~pfsc_drake.control.estimation.generalized_momentum.MomentumModel`, shape
            (N,) [Nm or N]; zero if not connected.
        estimate (output): z and its derivatives by rows, shape ((num_derivatives + 1) N,)
            [Nm or N, per s, per s^2]. What drives the joints may depend on it.

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
        """See :class:`Block`."""
        model, T = self._model, self._period
        p, f = self._momentum(u.joint_state)
        tau = model.acting_when_measured(x.acting, x.acted, T)
        z_mean = model.sign * ((p - x.momentum) / T - (f + x.forces) / 2.0 - tau)
        predicted = x.estimate[: model.dimension]
        sample = where(x.seen > 0.0, z_mean, predicted)
        estimate = self._filter.estimate(x.estimate, sample)
        return {"estimate": estimate, "momentum": p, "forces": f}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        sampled = {
            "estimate": self._filter.predict(y.estimate),
            "momentum": y.momentum,
            "forces": y.forces,
            "acting": self._model.acting(u.drive_torque, u.known_torque),
            "acted": x.acting,
        }
        kept, good = kept_if_finite(sampled, x)
        return kept | {"seen": good}
