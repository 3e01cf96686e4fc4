"""Reference motions along a path, and a smooth start at the tool."""

from collections.abc import Sequence
from math import comb
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import is_finite, where
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.jets import Jet, compose

# velocity on a ramp of unit length and height: C^3 at both ends, so that the
# position is C^4, which the elastic law needs (3.67)
_RAMP = np.polynomial.Polynomial([0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0])
_RAMP_PEAK_SLOPE = 35.0 / 16.0


def rest_to_rest(
    points: Sequence[float], *, velocity: float, acceleration: float, dwell: float = 0.0
) -> PiecewisePolynomialCurve:
    """Return a C^4 motion that comes to rest at every one of several points.

    Each move ramps the velocity up by a polynomial of degree 7, cruises, and ramps
    it down; a move too short for the full velocity is made of two ramps.

    Args:
        points: Positions to visit [m]; the first is the start.
        velocity: Largest velocity [m/s].
        acceleration: Largest acceleration [m/s^2].
        dwell: Rest before the first and after every move [s].

    Returns:
        A curve of dimension 1 over time [s], starting at t = 0.

    Raises:
        InputError: If there are fewer than two points, a limit is not positive, or a part of the
            motion is too short to be resolved in time.
    """
    for name, value in {"velocity": velocity, "acceleration": acceleration}.items():
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"reference {name}: {value}; must be a positive number")
    if not (np.isfinite(dwell) and dwell >= 0.0):
        raise InputError(f"reference dwell: {dwell}; must be zero or a positive number")
    if len(points) < 2 or not np.all(np.isfinite(points)):
        raise InputError(f"reference points: {list(points)}; two or more finite numbers are needed")
    times = [0.0]
    pieces: list[np.ndarray] = []

    def add(duration: float, polynomial: np.polynomial.Polynomial) -> None:
        if duration > 0.0:
            pieces.append(np.pad(polynomial.coef, (0, 9 - len(polynomial.coef))))
            times.append(times[-1] + duration)
            if not times[-2] < times[-1] < np.inf:
                raise InputError(
                    f"reference: a part of the motion takes {duration:.3g} s from "
                    f"t = {times[-2]:.6g} s on, below the resolution of time; allowed: velocity, "
                    "acceleration and dwell closer to the length of the motion"
                )

    position = float(points[0])
    add(dwell, np.polynomial.Polynomial([position]))
    for target in points[1:]:
        for duration, motion in _move(float(target) - position, velocity, acceleration):
            add(duration, motion + position)
            position += motion(duration)
        position = float(target)
        add(dwell, np.polynomial.Polynomial([position]))
    if not pieces:
        raise InputError(f"reference points: {list(points)}; at least two must differ")
    return PiecewisePolynomialCurve(np.array(times), np.array(pieces)[:, :, None], closed=False)


def _move(
    distance: float, velocity: float, acceleration: float
) -> list[tuple[float, np.polynomial.Polynomial]]:
    """Return durations and polynomials in local time of one move, each from 0."""
    if distance == 0.0:
        return []
    # a ramp of duration T covers velocity T / 2 and peaks at _RAMP_PEAK_SLOPE velocity / T
    peak = min(velocity, float(np.sqrt(abs(distance) * acceleration / _RAMP_PEAK_SLOPE)))
    ramp_time = _RAMP_PEAK_SLOPE * peak / acceleration
    cruise_time = abs(distance) / peak - ramp_time
    if cruise_time < 1e-9 * ramp_time:
        # two ramps; rounding must not leave a sliver of a cruise between them
        peak, cruise_time = abs(distance) / ramp_time, 0.0
    speed = float(np.copysign(peak, distance))
    identity = np.polynomial.Polynomial([0.0, 1.0 / ramp_time])
    rise = (_RAMP(identity) * speed).integ()
    cruise = np.polynomial.Polynomial([0.0, speed])
    return [(ramp_time, rise), (cruise_time, cruise), (ramp_time, cruise - rise)]


def straight_lines(
    places: Sequence[Sequence[float]], velocity: float, acceleration: float, dwell: float = 0.0
) -> PiecewisePolynomialCurve:
    """Return a C^4 motion of several coordinates along straight lines, with rests at all points.

    Args:
        places: Coordinates to visit, each of the same number [m]; the first is the start.
        velocity: Largest velocity of a coordinate [m/s].
        acceleration: Largest acceleration of a coordinate [m/s^2].
        dwell: Rest before the first and after every move [s].

    Returns:
        A curve of as many dimensions over time [s], starting at t = 0.

    Raises:
        InputError: If fewer than two points differ, the motion is far too long or short, or points
            have different numbers of coordinates.
    """
    table = _check_points(places)
    # the coordinate with the longest distance is limited, the others move in proportion
    largest = np.abs(np.diff(table, axis=0)).max(axis=1)
    distances = np.concatenate([[0.0], np.cumsum(largest)])
    along = rest_to_rest(
        distances.tolist(), velocity=velocity, acceleration=acceleration, dwell=dwell
    )
    middles = (along.breakpoints[:-1] + along.breakpoints[1:]) / 2.0
    progress = along.derivatives(middles, 0)[:, 0, 0]
    leg = np.clip(np.searchsorted(distances, progress) - 1, 0, len(largest) - 1)
    direction = np.diff(table, axis=0) / np.where(largest > 0.0, largest, 1.0)[:, None]
    coefficients = along.coefficients * direction[leg][:, None, :]
    coefficients[:, 0] += table[leg] - distances[leg][:, None] * direction[leg]
    return PiecewisePolynomialCurve(along.breakpoints, coefficients, closed=False)


def together(
    *motions: tuple[Sequence[float], float, float, float],
) -> PiecewisePolynomialCurve:
    """Return motions of several coordinates that start together, each with its own duration.

    Args:
        motions: For each coordinate points, velocity, acceleration and dwell as for
            :func:`rest_to_rest`; coordinates that end earlier rest.

    Returns:
        A curve of as many dimensions over time [s], starting at t = 0.

    Raises:
        InputError: If fewer than two points differ, or the motion is far too long or short.
    """
    single = [
        rest_to_rest(points, velocity=velocity, acceleration=acceleration, dwell=dwell)
        for points, velocity, acceleration, dwell in motions
    ]
    breakpoints = np.unique(np.concatenate([motion.breakpoints for motion in single]))
    # times that are equal up to rounding
    apart = np.diff(breakpoints, append=np.inf) > 1e-9 * breakpoints[-1]
    breakpoints = breakpoints[apart]
    breakpoints[0] = 0.0
    table = np.zeros((len(breakpoints) - 1, single[0].coefficients.shape[1], len(single)))
    for k, motion in enumerate(single):
        for i, begin in enumerate(breakpoints[:-1]):
            piece = int(np.searchsorted(motion.breakpoints, begin + 1e-9, side="right")) - 1
            if piece < len(motion.coefficients):
                own = motion.coefficients[piece, :, 0]
                table[i, :, k] = _shift(own, begin - motion.breakpoints[piece])
            else:
                table[i, 0, k] = motion.derivatives(motion.breakpoints[-1:], 0)[0, 0, 0]
    return PiecewisePolynomialCurve(breakpoints, table, closed=False)


def _shift(coefficients: np.ndarray, step: float) -> np.ndarray:
    """Return the coefficients of a polynomial about a shifted point."""
    orders = range(len(coefficients))
    moved = [[comb(k, j) * step ** (k - j) if k >= j else 0.0 for k in orders] for j in orders]
    return np.array(moved) @ coefficients


def _check_points(points: Sequence[Sequence[float]]) -> np.ndarray:
    sizes = {len(point) for point in points}
    if len(points) < 2 or len(sizes) != 1 or not np.all(np.isfinite(np.concatenate(points))):
        raise InputError(
            f"reference places: {[list(point) for point in points]}; two or more of as many "
            "finite numbers each are needed"
        )
    return np.array(points, dtype=float)


# from 0 to 1 on a unit interval with four derivatives that vanish at both ends, so that the
# reference of the elastic law, which needs four (3.67), is steady
_STEP = np.polynomial.Polynomial([0.0, 0.0, 0.0, 0.0, 0.0, 126.0, -420.0, 540.0, -315.0, 70.0])
_HIGHEST_ORDER = 4


class Transition:
    """Transition ``s(t)`` from 1 to 0 with derivatives: remaining share of the initial distance.

    A reference ``y_d(t) + s(t) (y(0) - y_d(0))`` starts at ``y(0)``, at rest if ``y_d`` is, and is
    equal to ``y_d`` from ``duration`` on.

    Args:
        duration: Duration of the transition [s].
        order: Highest derivative that is needed, at most 4.

    Attributes:
        duration: Duration of the transition [s].
        order: Highest derivative.

    Raises:
        InputError: If the duration is not positive or the order too high.
    """

    def __init__(self, duration: float, order: int) -> None:
        if not (np.isfinite(duration) and duration > 0.0):
            raise InputError(f"transition: {duration} s; must be a positive number")
        if not 0 <= order <= _HIGHEST_ORDER:
            raise InputError(f"transition: order {order}; must be 0 to {_HIGHEST_ORDER}")
        self.duration, self.order = duration, order
        rest = 1.0 - _STEP
        # row k holds the coefficients of the k-th derivative, in real time
        self._coefficients = np.zeros((order + 1, rest.coef.size))
        for k in range(order + 1):
            derivative = np.asarray((rest.deriv(k) if k else rest).coef, dtype=float)
            self._coefficients[k, : derivative.size] = derivative / duration**k

    def at(self, time: Any) -> Any:
        """Return ``s`` and its derivatives, shape (order + 1,) [1, 1/s, ..].

        Args:
            time: Time since the start [s], number or expression; limited to 0 .. ``duration``.
        """
        x = ca.fmin(ca.fmax(time / self.duration, 0.0), 1.0)
        s = ca.DM.zeros(self.order + 1)
        for coefficients in reversed(self._coefficients.T):
            s = s * x + ca.DM(coefficients)
        return s


class SmoothStart(Block):
    """Start of a reference at the tool, with a transition to the desired one, see Transition.

        y_p(t) = y_d(t) + s(t) (y(0) - y_d(0))

    Ports:
        desired_reference (input): Derivatives 0..order of the desired reference ``y_d`` by rows,
            shape ((order + 1) m,).
        manifold_state (input): Derivatives 0.. of the virtual output y by rows, m each, used
            at the start only.
        own_time (input, optional): Time of the reference and its derivatives, shape (order + 1,)
            [s, 1, 1/s, ..]: while the reference waits, the transition waits, too. Time of the
            clock if not connected.
        reference (output): Derivatives 0..order of ``y_p`` by rows, shape ((order + 1) m,).

    State:
        distance: ``y(0) - y_d(0)``, shape (m,); zero without a tool position. begin: Sample of the
        start, or own time then [s].

    Args:
        duration: Duration of the transition [s].
        order: Highest derivative.
        num_outputs: m.
        state_size: State size of ``manifold_state``.
        period: Sampling time [s].

    Raises:
        InputError: If duration or order are out of range.
    """

    def __init__(
        self, duration: float, order: int, num_outputs: int, state_size: int, period: float
    ) -> None:
        self._transition, self._m, self._period = Transition(duration, order), num_outputs, period
        size = (order + 1) * num_outputs
        self.inputs = {
            "desired_reference": Port(size),
            "manifold_state": Port(state_size),
            "own_time": Port(order + 1, "s, 1, 1/s, ..", optional=True),
        }
        self.outputs = {"reference": Port(size)}
        self.states = {"distance": num_outputs, "begin": 1}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted states are zero."""
        distance = u.manifold_state[: self._m] - u.desired_reference[: self._m]
        begin = t if u.own_time is None else u.own_time[0]
        return {"distance": where(is_finite(distance), distance, 0.0), "begin": begin}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        if u.own_time is None:
            elapsed = (t - x.begin) * self._period
            share = self._transition.at(elapsed)
        else:
            elapsed, *rates = ca.vertsplit(u.own_time - ca.vertcat(x.begin, 0.0 * u.own_time[1:]))
            derivatives = ca.vertsplit(self._transition.at(elapsed))
            moved = compose(derivatives, Jet.from_derivatives([elapsed, *rates]))
            share = ca.vertcat(*moved.derivatives())
        left = ca.vec(x.distance @ share.T)
        rest = where(elapsed < self._transition.duration, left, 0.0)
        return {"reference": u.desired_reference + rest}
