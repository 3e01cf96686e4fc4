"""Motion along a manifold with a speed scaling from outside, and its predicted stop."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Port, Values
from pfsc_drake.control.law.timed_reference import TimedReference
from pfsc_drake.control.obstacles.stoppable_scaling import StoppableScaling
from pfsc_drake.geometry import PiecewisePolynomialCurve


class WaitingReference(TimedReference):
    """A :class:`TimedReference` with an override that depends on its position.

    It starts at rest. Its ``clock`` depends on the state alone, so that an override computed from
    it closes no algebraic loop.

    Ports:
        override (input): See :class:`TimedReference`, shape (1,).
        reference (output): See :class:`TimedReference`.
        clock (output): Own time s, speed scaling ``z_1``, own time of rest with override 0, and the
            lags ``z_2`` to ``z_r`` of the scaling, see :class:`StoppableScaling`, shape (r + 2,)
            [s, 1, s, 1, ..].
        own_time (output): Own time and its derivatives 1..r, shape (r + 1,) [s, 1, 1/s, ..].

    Args:
        eta_p: See :class:`TimedReference`.
        scaling: Stoppable speed scaling; the override's filter has its order r and bandwidth.
        num_outputs: m.
        period: Sampling time T [s].
    """

    def __init__(
        self,
        eta_p: PiecewisePolynomialCurve,
        scaling: StoppableScaling,
        num_outputs: int,
        period: float,
    ) -> None:
        super().__init__(eta_p, scaling.order, num_outputs, period, scaling.bandwidth)
        self._waiting = scaling
        self.inputs = {"override": Port(1)}
        self.outputs = {
            **self.outputs,
            "clock": Port(scaling.order + 2, "s, 1, s, 1, .."),
            "own_time": Port(scaling.order + 1, "s, 1, 1/s, .."),
        }

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states, at rest; omitted states are zero."""
        return {"pace": ca.vertcat(t * self._period, ca.DM.zeros(self._order))}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        s, *rates = ca.vertsplit(x.pace)
        lags = self._waiting.lags(rates)
        clock = ca.vertcat(s, lags[0], self._waiting.rest(s, lags), *lags[1:])
        return {**super().output(x, u, t), "clock": clock, "own_time": x.pace}
