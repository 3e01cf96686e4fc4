"""Motion along a manifold at a pace that others decide, and that tells where it would stop."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Port, Values
from pfsc_drake.control.law.timed_reference import TimedReference
from pfsc_drake.control.obstacles.waiting_pace import WaitingPace
from pfsc_drake.geometry import PiecewisePolynomialCurve


class WaitingReference(TimedReference):
    """A :class:`TimedReference` whose override depends on where it is.

    It starts at rest. Its ``clock`` is a state alone, so that what decides over the override from
    it closes no algebraic loop.

    Ports:
        override (input): As there, shape (1,).
        reference (output): As there.
        clock (output): Own time s, the pace ``z_1``, where s comes to rest if nothing more is
            asked for, and the lags ``z_2`` to ``z_r`` of the pace, see :class:`WaitingPace`, shape
            (r + 2,) [s, 1, s, 1, ..].
        own_time (output): Own time and its derivatives 1..r, shape (r + 1,) [s, 1, 1/s, ..].

    Args:
        eta_p: As there.
        pace: How it can be stopped; its order r and bandwidth are those of the override's filter.
        num_outputs: m.
        period: Sampling time T [s].
    """

    def __init__(
        self, eta_p: PiecewisePolynomialCurve, pace: WaitingPace, num_outputs: int, period: float
    ) -> None:
        super().__init__(eta_p, pace.order, num_outputs, period, pace.bandwidth)
        self._waiting = pace
        self.inputs = {"override": Port(1)}
        self.outputs = {
            **self.outputs,
            "clock": Port(pace.order + 2, "s, 1, s, 1, .."),
            "own_time": Port(pace.order + 1, "s, 1, 1/s, .."),
        }

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero; at rest."""
        return {"pace": ca.vertcat(t * self._period, ca.DM.zeros(self._order))}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        s, *rates = ca.vertsplit(x.pace)
        lags = self._waiting.lags(rates)
        clock = ca.vertcat(s, lags[0], self._waiting.rest(s, lags), *lags[1:])
        return {**super().output(x, u, t), "clock": clock, "own_time": x.pace}
