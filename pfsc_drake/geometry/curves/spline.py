"""Splines: through waypoints, and on equally spaced knots."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, make_interp_spline
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve

Parametrization = Literal["chord", "centripetal"]

_MIN_SMOOTHNESS, _MAX_SMOOTHNESS = 2, 6
# Periodic splines of more waypoints are solved by sparse matrices.
_DENSE = 1000
# Waypoints closer than this part of the path's chord length are one point.
_COINCIDENT = 1e-9


def interpolate(
    waypoints: ArrayLike,
    *,
    smoothness: int,
    closed: bool = False,
    parametrization: Parametrization = "chord",
    parameters: ArrayLike | None = None,
) -> PiecewisePolynomialCurve:
    """Return a spline of degree smoothness + 1 through waypoints, of class C^smoothness.

    Args:
        waypoints: Points [n, dimension], m. If `closed`, the last one may repeat the first.
        smoothness: k of the class C^k, 2..6 (3 for rigid, 5 for elastic joints, section 3.1).
        closed: True for a periodic curve.
        parametrization: "chord": theta is the accumulated distance of the waypoints, m;
            "centripetal": increments are square roots of the distances, scaled to
            the same total. Ignored if `parameters` is given.
        parameters: theta of the waypoints, strictly increasing: [n], or [n + 1] with the
            end of the period last if `closed` and the first waypoint is not repeated.

    Returns:
        The curve; its domain begins at 0 (or at the first of `parameters`).

    Raises:
        InputError: too few waypoints, coincident neighbours, values that are not finite,
            or options that are not allowed.
    """
    points = _check_waypoints(waypoints)
    check_smoothness(smoothness)
    points, chords = close_polygon(points, closed)
    degree = smoothness + 1
    distinct, needed = (len(points) - 1, 3) if closed else (len(points), degree + 1)
    if distinct < needed:
        kind = "closed" if closed else "open"
        raise InputError(
            f"waypoints: {distinct} distinct for {'a' if closed else 'an'} {kind} curve"
            f" of class C^{smoothness}; at least {needed} are needed"
        )
    if parameters is None:
        knots = accumulate(chords, parametrization)
    else:
        knots = check_parameters(parameters, len(points))
    return interpolate_at(knots, points, degree, closed=closed)


def close_polygon(points: np.ndarray, closed: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of a polygon, and the lengths of its sides.

    Args:
        points: [n, dimension], m. If `closed`, the last one may repeat the first.
        closed: Whether a side leads from the last point to the first.

    Returns:
        Points, with the first once more at the end if `closed`, and lengths, m, positive.

    Raises:
        InputError: neighbours coincide.
    """
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    tiny = _COINCIDENT * float(chords.sum())
    if closed and not np.linalg.norm(points[-1] - points[0]) <= tiny:
        points = np.vstack([points, points[0]])
        chords = np.append(chords, np.linalg.norm(points[-1] - points[-2]))
    if np.any(chords <= tiny):
        row = int(np.argmax(chords <= tiny))
        raise InputError(
            f"waypoints: {row + 1} and {row + 2} coincide at {points[row].tolist()};"
            " neighbours must differ"
        )
    return points, chords


def interpolate_at(
    parameters: np.ndarray, points: np.ndarray, degree: int, *, closed: bool
) -> PiecewisePolynomialCurve:
    """Return a spline of a degree through points at prescribed parameters.

    Args:
        parameters: theta [n], strictly increasing.
        points: Points [n, dimension]; if `closed`, the last is the first again.
        degree: Degree of the polynomials; an open curve needs n > degree.
        closed: True for a periodic curve.

    Returns:
        The curve on [parameters[0], parameters[-1]], of class C^(degree - 1).
    """
    if closed:
        spline, starts = _periodic_spline(parameters, points[:-1], degree)
    else:
        # Not-a-knot ends: the spline reproduces polynomials of its degree.
        spline = make_interp_spline(parameters, points, k=degree)
        starts = np.unique(spline.t[degree:-degree])[:-1]
    return piecewise(spline, starts, parameters[-1], closed=closed)


def piecewise(
    spline: BSpline, starts: np.ndarray, end: float, *, closed: bool
) -> PiecewisePolynomialCurve:
    """Return a B-spline as a curve of polynomials.

    Args:
        spline: Spline of simple knots; defined over a whole period, wherever it begins, if
            `closed`.
        starts: First parameters of the pieces, [pieces].
        end: End of the last piece; end of the period if `closed`.
        closed: True for a periodic curve.

    Returns:
        The curve on [starts[0], end], of class C^(k - 1) for a spline of degree k.
    """
    degree = spline.k
    # The piece to the right of its start is expanded there; in a periodic spline of even
    # degree the first start lies inside the piece that crosses the seam.
    sites = starts.copy()
    if closed:
        sites[starts < spline.t[degree]] += end - starts[0]
    coefficients = np.stack(
        [spline(sites, nu=j) / math.factorial(j) for j in range(degree + 1)], axis=1
    )
    breakpoints = np.append(starts, end)
    return PiecewisePolynomialCurve(
        breakpoints, coefficients, closed=closed, known_smoothness=degree - 1
    )


def _periodic_spline(
    parameters: np.ndarray, points: np.ndarray, degree: int
) -> tuple[BSpline, np.ndarray]:
    """Return the periodic interpolating spline and the parameters at which its pieces start.

    The knots of an even degree lie midway between the waypoints, in every interval:
    SciPy's own periodic knots omit one interval and put a knot on a waypoint, which
    makes the curve depend on the start of the period.
    """
    count = len(points)
    period = parameters[-1] - parameters[0]
    if degree % 2:
        base, sites, values = parameters[:-1], parameters[:-1], points
        starts = base
    else:
        base = (parameters[1:] + parameters[:-1]) / 2.0
        sites, values = parameters[1:], np.roll(points, -1, axis=0)
        starts = np.append(parameters[0], base)
    index = np.arange(-degree, count + degree + 1)
    knots = base[index % count] + period * (index // count)
    folded = _fold_columns(BSpline.design_matrix(sites, knots, degree), count)
    if count <= _DENSE:
        coefficients = np.linalg.solve(folded.toarray(), values)
    else:
        coefficients = splu(folded.tocsc()).solve(values)
    return BSpline(knots, coefficients[np.arange(count + degree) % count], degree), starts


def _fold_columns(matrix: csr_array, period: int) -> csr_array:
    """Return the sum of the columns that are whole periods apart, [rows, period]."""
    entries = matrix.tocoo()
    indices = (entries.row, entries.col % period)
    return csr_array((entries.data, indices), shape=(matrix.shape[0], period))


@dataclass(frozen=True)
class UniformKnots:
    """Equally spaced simple knots of a B-spline in one direction.

    Attributes:
        begin: Begin of the domain.
        end: End of the domain.
        intervals: Number of knot intervals.
        degree: Degree of the polynomials.
        closed: True for a periodic spline.
    """

    begin: float
    end: float
    intervals: int
    degree: int
    closed: bool

    @property
    def step(self) -> float:
        """Distance of neighbouring knots."""
        return (self.end - self.begin) / self.intervals

    @property
    def knots(self) -> np.ndarray:
        """All knots, those outside of the domain too, [intervals + 2 degree + 1]."""
        multiples = np.arange(-self.degree, self.intervals + self.degree + 1)
        return self.begin + self.step * multiples

    @property
    def count(self) -> int:
        """Number of distinct coefficients."""
        return self.intervals if self.closed else self.intervals + self.degree

    @property
    def linear(self) -> np.ndarray:
        """Coefficients of the function theta itself, of an open direction, [count]."""
        return self.begin + self.step * (np.arange(self.count) - (self.degree - 1) / 2.0)

    def entries(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return indices and values of nonzero B-splines at parameters [n], [n, degree + 1]."""
        knots = self.knots
        # Knots are multiples of a step: the ends are not exactly on them.
        inside = np.clip(theta, knots[self.degree], knots[-self.degree - 1])
        matrix = BSpline.design_matrix(inside, knots, self.degree)
        shape = (len(theta), self.degree + 1)
        return matrix.indices.reshape(shape) % self.count, matrix.data.reshape(shape)

    def basis(self, theta: np.ndarray) -> csr_array:
        """Return B-splines at parameters [n] within the domain, [n, count]."""
        columns, values = self.entries(theta)
        rows = np.broadcast_to(np.arange(len(theta))[:, None], columns.shape)
        indices = (rows.ravel(), columns.ravel())
        return csr_array((values.ravel(), indices), shape=(len(theta), self.count))

    def unfold(self, coefficients: np.ndarray) -> np.ndarray:
        """Return coefficients of all knots from the distinct ones, along the first axis."""
        return coefficients[np.arange(self.intervals + self.degree) % self.count]

    def curve(self, coefficients: np.ndarray) -> PiecewisePolynomialCurve:
        """Return the spline in this direction, [count, dimension], as a curve of polynomials."""
        knots = self.knots
        spline = BSpline(knots, self.unfold(coefficients), self.degree)
        starts = knots[self.degree : -self.degree - 1]
        return piecewise(spline, starts, self.end, closed=self.closed)


def accumulate(chords: np.ndarray, parametrization: Parametrization) -> np.ndarray:
    """Return parameters of waypoints from the distances of neighbours.

    Args:
        chords: Distances [n - 1], m, positive.
        parametrization: "chord" or "centripetal".

    Returns:
        theta [n], from 0 to the sum of the chords, m.

    Raises:
        InputError: unknown parametrization.
    """
    if parametrization == "chord":
        steps = chords
    elif parametrization == "centripetal":
        steps = np.sqrt(chords)
    else:
        raise InputError(
            f"parametrization: '{parametrization}'; 'chord' or 'centripetal' is allowed"
        )
    return np.concatenate([[0.0], np.cumsum(steps)]) * (chords.sum() / steps.sum())


def check_smoothness(smoothness: int) -> None:
    """Refuse a class C^k that no spline here has.

    Raises:
        InputError: it is not an integer from 2 to 6.
    """
    if not isinstance(smoothness, int) or not _MIN_SMOOTHNESS <= smoothness <= _MAX_SMOOTHNESS:
        raise InputError(
            f"smoothness: {smoothness}; an integer from {_MIN_SMOOTHNESS} to {_MAX_SMOOTHNESS}"
            " is required"
        )


def check_parameters(parameters: ArrayLike, count: int) -> np.ndarray:
    """Return parameters of waypoints as an array, strictly increasing.

    Args:
        parameters: theta [count].
        count: Number of waypoints, the closing one of a closed curve included.

    Returns:
        Array [count].

    Raises:
        InputError: wrong number, not finite or not increasing.
    """
    values = np.asarray(parameters, dtype=float)
    if values.shape != (count,):
        raise InputError(
            f"parameters: shape {values.shape}; one for each waypoint, ({count},), is required"
        )
    bad = ~(np.diff(values) > 0.0) | ~np.isfinite(values[1:]) | ~np.isfinite(values[:-1])
    if np.any(bad):
        row = int(np.argmax(bad))
        raise InputError(
            f"parameters {row + 1} and {row + 2}: {values[row]:.9g} and {values[row + 1]:.9g};"
            " they must be finite and strictly increase"
        )
    return values


def _check_waypoints(waypoints: ArrayLike) -> np.ndarray:
    points = np.array(waypoints, dtype=float)
    if points.ndim != 2 or points.shape[0] < 2 or points.shape[1] < 1:
        raise InputError(f"waypoints: shape {points.shape}; [2 or more, dimension] is required")
    if not np.all(np.isfinite(points)):
        row = int(np.argwhere(~np.isfinite(points))[0, 0])
        raise InputError(f"waypoint {row + 1}: {points[row].tolist()}; finite values are required")
    return points
