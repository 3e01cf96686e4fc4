"""Motion along a manifold over time: planned, with a speed override, or streamed."""

import math
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import expm

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import is_finite, where
from pfsc_drake.checks import require_positive
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.geometry.curves.polynomial import PieceTable
from pfsc_drake.jets import Jet, compose
from pfsc_drake.yaml.rules import Parameters, Positive

# of the planned speed; backwards likewise
LARGEST_SCALING = 1.5


class TimedReference(Block):
    """Reference of the virtual output, ``yhat_p = (eta_p(s), 0, ..)``, over time s.

    Transversal and rotational references are zero. Before the motion and after it the reference
    rests.

    With an override w the motion's own time s runs w times as fast as the clock: 0 stops it, up to
    1.5 it is faster, below zero it moves backwards. A filter of order r, with r equal poles
    ``-bandwidth``, makes w smooth enough for the law::

        s' = z_1,   (d/dt / bandwidth + 1)^r z_1 = w

    so that s, and with it the reference, has r continuous derivatives for any jumps of w. The tool
    stays on the path: only its progress changes. NaN or infinity counts as 0.

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
        bandwidth: Bandwidth of the override's filter [1/s].

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
        """Return the initial states.

        Omitted states are zero; a motion starts with the requested speed scaling.
        """
        if u.override is None:
            return {}
        start = [t * self._period, _limited_scaling(u.override), *[0.0] * (self._order - 1)]
        return {"pace": ca.vertcat(*start)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
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
        """Return the next states; omitted states do not change."""
        if u.override is None:
            return {}
        s, *rates = ca.vertsplit(
            ca.DM(self._step) @ ca.vertcat(x.pace, _limited_scaling(u.override))
        )
        return {"pace": ca.vertcat(ca.fmin(ca.fmax(s, self._begin), self._end), *rates)}


def _limited_scaling(override: Any) -> Any:
    """Return the requested speed scaling, limited to the allowed range."""
    number = where(ca.fabs(override) < ca.inf, override, 0.0)
    return ca.fmin(ca.fmax(number, -LARGEST_SCALING), LARGEST_SCALING)


def _derivatives(curve: PiecewisePolynomialCurve, order: int) -> PieceTable:
    """Return the table of derivatives 0..order of all coordinates, one coordinate after another."""
    pieces, powers, dimension = curve.coefficients.shape
    table = np.zeros((pieces, dimension, order + 1, powers))
    table[:, :, 0] = curve.coefficients.transpose(0, 2, 1)
    for j in range(1, order + 1):
        table[:, :, j, :-1] = np.arange(1, powers) * table[:, :, j - 1, 1:]
    return PieceTable(curve.breakpoints, table.reshape(pieces, -1, powers))


def _filter_step(order: int, bandwidth: float, period: float) -> np.ndarray:
    """Return the step ``(s, z_1, .., z_r, w) -> (s, z_1, .., z_r)`` with w held over a period."""
    poles = np.polynomial.polynomial.polyfromroots([-bandwidth] * order)
    rates = np.zeros((order + 2, order + 2))
    rates[: order + 1, 1:] = np.eye(order + 1)
    rates[order] = 0.0
    rates[order, 1 : order + 1] = -poles[:-1]
    rates[order, order + 1] = poles[0]
    return np.asarray(expm(period * rates)[: order + 1])


@dataclass
class StreamLimits(Parameters):
    """Limits of the motion to successive waypoints.

    Attributes:
        velocity: Largest speed V [m/s].
        acceleration: Largest acceleration A [m/s^2].
        bandwidth: Bandwidth of the smoothing filter for the law [1/s].
    """

    velocity: Positive = 0.1
    acceleration: Positive = 0.5
    bandwidth: Positive = 20.0


class StreamedReference(Block):
    """Reference of the arc length towards the last received waypoint.

    A point p on the path moves to the last waypoint g with a speed v that changes by ``A T`` at
    most in each sample, up to the largest from which it can still stop there::

        v+ = min(V, v + A T, A (sqrt(T^2 + 2 c / A) - T)),   c = g - p - T v / 2
        p+ = p + T (v + v+) / 2

    so that always ``p + T v / 2 + v^2 / (2 A) <= g``. The reference follows p through r equal lags,
    ``(d/dt / bandwidth + 1)^r y = p``, exactly between samples. Their impulse response is
    positive and its integral is 1: y is a mean of past p, and so are its rates. Hence y has r
    continuous derivatives whenever waypoints are received, is never beyond the last one, nor faster
    than V, nor accelerated more than A. Without further waypoints it comes to rest at the last one.
    Transversal and rotational references are zero.

    Ports:
        goal (input): Arc length of the last waypoint [m], shape (1,). NaN, infinity, or a smaller
            value than before is ignored: waypoints are in order.
        speed (input, optional): Largest speed from now on [m/s], shape (1,), limited to 0 .. V; V
            if not connected. NaN or infinity counts as 0.
        reference (output): Derivatives 0..r of ``yhat_p`` by rows, shape ((r + 1) m,)
            [m, m/s, ...].

    State:
        goal: g [m]. place: ``[p, v]`` [m, m/s]. filtered: Derivatives 0..r-1 of y, shape (r,).

    Args:
        limits: Limits of the motion.
        order: r, of the highest derivative.
        num_outputs: m.
        period: Sampling time T [s].
        start: Initial position at rest [m].
        end: End of the path [m]; waypoints beyond it count as its end.
    """

    def __init__(
        self,
        limits: StreamLimits,
        order: int,
        num_outputs: int,
        period: float,
        *,
        start: float = 0.0,
        end: float = math.inf,
    ) -> None:
        self._limits, self._order, self._m, self._period = limits, order, num_outputs, period
        self._start, self._end = start, end
        self._rates = lags(order, limits.bandwidth)
        self._step = ca.DM(expm(period * self._rates)[:-1])
        self.inputs = {"goal": Port(1, "m"), "speed": Port(1, "m/s", optional=True)}
        self.outputs = {"reference": Port((order + 1) * num_outputs, "m, m/s, ..")}
        self.states = {"goal": 1, "place": 2, "filtered": order}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states, at rest; omitted states are zero."""
        start = ca.DM(self._start)
        rest = ca.DM.zeros(self._order - 1)
        return {
            "goal": start,
            "place": ca.vertcat(start, 0.0),
            "filtered": ca.vertcat(start, rest),
        }

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        top = ca.DM(self._rates[self._order - 1, :-1]).T @ ca.vertcat(x.filtered, x.place)
        eta = ca.vertcat(x.filtered, top)
        rest = ca.MX(self._order + 1, self._m - 1)
        return {"reference": ca.vec(ca.horzcat(eta, ca.densify(rest)).T)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the next states; omitted states do not change."""
        goal = ca.fmax(x.goal, ca.fmin(where(is_finite(u.goal), u.goal, x.goal), self._end))
        speed = self._speed(x, u, goal)
        acceleration = (speed - x.place[1]) / self._period
        after = self._step @ ca.vertcat(x.filtered, x.place, acceleration)
        # rounding must not exceed the goal
        position = ca.fmin(after[self._order], goal)
        return {
            "goal": goal,
            "place": ca.vertcat(position, speed),
            "filtered": after[: self._order],
        }

    def _speed(self, x: Values, u: Values, goal: Any) -> Any:
        """Return ``v+``."""
        A, T = self._limits.acceleration, self._period
        position, speed = ca.vertsplit(x.place)
        left = ca.fmax(goal - position - T * speed / 2.0, 0.0)
        fastest = allowed_speed(self._limits, u.speed)
        speed_limit = ca.fmin(ca.fmin(fastest, speed + A * T), speed_to_stop(left, A, T))
        return ca.fmax(speed_limit, ca.fmax(speed - A * T, 0.0))


def allowed_speed(limits: StreamLimits, requested: Any) -> Any:
    """Return the largest speed from now on [m/s].

    Args:
        limits: Its limit V.
        requested: Requested speed [m/s], or None; NaN or infinity counts as 0.
    """
    fastest = ca.DM(limits.velocity)
    if requested is None:
        return fastest
    return ca.fmin(ca.fmax(where(is_finite(requested), requested, 0.0), 0.0), fastest)


def speed_to_stop(left: Any, acceleration: float, period: float) -> Any:
    """Return the largest speed at the end of a period from which a stop is possible [m/s].

    Args:
        left: Remaining distance minus half a period at the speed before [m], not negative.
        acceleration: A [m/s^2].
        period: T [s].
    """
    # the difference of two roots, without cancellation
    return 2.0 * left / (ca.sqrt(period**2 + 2.0 * left / acceleration) + period)


def lags(order: int, bandwidth: float) -> np.ndarray:
    """Return the rates of ``[y, y', .., y^(r-1), p, v, a]``, shape (r + 3, r + 3)."""
    poles = np.polynomial.polynomial.polyfromroots([-bandwidth] * order)
    rates = np.zeros((order + 3, order + 3))
    rates[: order - 1, 1:order] = np.eye(order - 1)
    rates[order - 1, :order] = -poles[:-1]
    rates[order - 1, order] = poles[0]
    rates[order, order + 1] = rates[order + 1, order + 2] = 1.0
    return rates
