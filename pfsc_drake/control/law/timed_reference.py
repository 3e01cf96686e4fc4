"""Motion along a manifold over time, at the pace that an override asks for."""

from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import expm

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import where
from pfsc_drake.checks import require_positive
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.geometry.piece_table import PieceTable
from pfsc_drake.jets import Jet, compose

# of the pace that was planned; backwards likewise
FASTEST_PACE = 1.5


class TimedReference(Block):
    """References of the virtual output, ``yhat_p = (eta_p(s), 0, ..)``, over time s.

    Transversal and rotational references are zero. Before the motion and after it the reference
    rests.

    With an override w the motion's own time s runs w times as fast as the clock: 0 stops it, up to
    1.5 it is faster, below zero it goes back. A filter of order r, with r equal poles
    ``-bandwidth``, makes of w what the law can follow::

        s' = z_1,   (d/dt / bandwidth + 1)^r z_1 = w

    so that s, and with it the reference, has r continuous derivatives however w jumps. The path is
    never left: only the progress on it changes. What is not a number counts as 0.

    Ports:
        override (input, optional): w, shape (1,), limited to -1.5 .. 1.5; 1 if not connected.
        reference (output): Derivatives 0..r of ``yhat_p`` by rows, shape ((r + 1) m,)
            [m, m/s, ...].

    State:
        pace (with an override only in use): s [s], ``z_1`` and its derivatives up to r - 1, shape
        (r + 1,).

    Args:
        eta_p: Tangential reference [m] over time [s], a curve of as many dimensions as there are
            tangential coordinates.
        order: r, of the highest derivative.
        num_outputs: m.
        period: Sampling time T [s].
        bandwidth: Of the override's filter [1/s].

    Raises:
        InputError: If the bandwidth is not positive.
    """

    def __init__(
        self,
        eta_p: PiecewisePolynomialCurve,
        order: int,
        num_outputs: int,
        period: float,
        bandwidth: float = 20.0,
    ) -> None:
        require_positive("bandwidth of the override", bandwidth)
        self._order, self._m, self._period = order, num_outputs, period
        self._begin, self._end = (float(limit) for limit in eta_p.domain)
        self._dimension = eta_p.coefficients.shape[2]
        self._derivatives = _derivatives(eta_p, order)
        self._step = _filter_step(order, bandwidth, period)
        self.inputs = {"override": Port(1, optional=True)}
        self.outputs = {"reference": Port((order + 1) * num_outputs, "m, m/s, ..")}
        self.states = {"pace": order + 1}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`; a motion starts at the pace that is asked for."""
        if u.override is None:
            return {}
        start = [t * self._period, _pace(u.override), *[0.0] * (self._order - 1)]
        return {"pace": ca.vertcat(*start)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        r = self._order
        if u.override is None:
            s, rates = ca.MX(t * self._period), [ca.MX(1.0), *[ca.MX(0.0)] * (r - 1)]
        else:
            s, *rates = ca.vertsplit(x.pace)
        within = where(s >= self._begin, where(s <= self._end, 1.0, 0.0), 0.0)
        # by columns: derivatives 0..r of each coordinate
        known = self._derivatives(ca.fmin(ca.fmax(s, self._begin), self._end))
        own_time = Jet.from_derivatives([s, *rates])
        columns = []
        for k in range(self._dimension):
            eta, *slopes = ca.vertsplit(known[k * (r + 1) : (k + 1) * (r + 1)])
            moved = compose([eta, *(within * slope for slope in slopes)], own_time)
            columns.append(ca.vertcat(*moved.derivatives()))
        rest = ca.MX(r + 1, self._m - self._dimension)
        rows = ca.horzcat(*columns, ca.densify(rest))
        return {"reference": ca.vec(rows.T)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        if u.override is None:
            return {}
        s, *rates = ca.vertsplit(ca.DM(self._step) @ ca.vertcat(x.pace, _pace(u.override)))
        return {"pace": ca.vertcat(ca.fmin(ca.fmax(s, self._begin), self._end), *rates)}


def _pace(override: Any) -> Any:
    """Return the pace that is asked for, within what is allowed."""
    number = where(ca.fabs(override) < ca.inf, override, 0.0)
    return ca.fmin(ca.fmax(number, -FASTEST_PACE), FASTEST_PACE)


def _derivatives(curve: PiecewisePolynomialCurve, order: int) -> PieceTable:
    """Return the table of derivatives 0..order of all coordinates, one coordinate after another."""
    pieces, powers, dimension = curve.coefficients.shape
    table = np.zeros((pieces, dimension * (order + 1), powers))
    for k in range(dimension):
        for piece in range(pieces):
            polynomial = np.polynomial.Polynomial(curve.coefficients[piece, :, k])
            for j in range(order + 1):
                coefficients = polynomial.deriv(j).coef if j else polynomial.coef
                table[piece, k * (order + 1) + j, : coefficients.size] = coefficients
    return PieceTable(curve.breakpoints, table)


def _filter_step(order: int, bandwidth: float, period: float) -> np.ndarray:
    """Return the step ``(s, z_1, .., z_r, w) -> (s, z_1, .., z_r)`` with w held over a period."""
    poles = np.polynomial.polynomial.polyfromroots([-bandwidth] * order)
    rates = np.zeros((order + 2, order + 2))
    rates[: order + 1, 1:] = np.eye(order + 1)
    rates[order] = 0.0
    rates[order, 1 : order + 1] = -poles[:-1]
    rates[order, order + 1] = poles[0]
    return np.asarray(expm(period * rates)[: order + 1])
