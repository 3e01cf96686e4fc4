"""Polygons with rounded corners."""

import math

import numpy as np
from numpy.polynomial import Polynomial

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve

_SHARPEST_DEG = 170.0
# Of the domain: shorter pieces are omitted.
_NOTHING = 1e-12


def round_corners(
    points: np.ndarray,
    parameters: np.ndarray,
    distances: np.ndarray,
    *,
    smoothness: int,
    closed: bool,
) -> PiecewisePolynomialCurve:
    """Return straight lines from point to point, with the corners blended.

    Around the corner at theta_i the slope changes from one line's to the next one's,

        sigma'(theta) = (1 - b) slope_i + b slope_i+1,    |theta - theta_i| < distance_i,

    with the polynomial b of lowest degree that rises from 0 to 1 with its first smoothness - 1
    derivatives zero at both ends. The curve never leaves the triangle of the corner and turns
    to one side only.

    Args:
        points: Corners [n, dimension]; if `closed`, the last is the first again.
        parameters: theta_i [n], strictly increasing.
        distances: Half widths of the blends in theta, positive: [n - 2] of the inner corners
            of an open curve, [n - 1] beginning with the first corner if `closed`. The sum of two
            neighbours must not exceed the line between them.
        smoothness: k of the class C^k.
        closed: True for a closed curve.

    Returns:
        The curve on [theta_0, theta_n-1].
    """
    slopes = np.diff(points, axis=0) / np.diff(parameters)[:, None]
    whole = _blend_integral(smoothness)
    terms = len(whole)
    second_half = _of_second_half(whole)
    starts: list[float] = []
    rows: list[np.ndarray] = []

    def add(start: float, end: float, row: np.ndarray) -> None:
        """Add a piece, unless neighbouring blends leave nothing of a line."""
        if end - start > _NOTHING * (parameters[-1] - parameters[0]):
            starts.append(start)
            rows.append(row)

    def line(start: float, end: float, corner: int) -> None:
        row = np.zeros((terms, points.shape[1]))
        row[0] = points[corner] + (start - parameters[corner]) * slopes[corner]
        row[1] = slopes[corner]
        add(start, end, row)

    def bend(corner: int, before: np.ndarray, after: np.ndarray, width: float, half: bool) -> None:
        """Add a blend from theta_i - width, or its second half from theta_i."""
        first = points[corner] - width * before
        length = width if half else 2.0 * width
        series = (second_half if half else whole) / length ** np.arange(terms)
        row = 2.0 * width * series[:, None] * (after - before)
        row[0] += first + (width * before if half else 0.0)
        row[1] += before
        begin = parameters[corner] - (0.0 if half else width)
        add(begin, begin + length, row)

    last = len(points) - 1
    inner = distances[1:] if closed else distances
    begin = parameters[0]
    if closed:
        bend(0, slopes[-1], slopes[0], distances[0], half=True)
        begin += distances[0]
    for corner in range(1, last):
        width = inner[corner - 1]
        line(begin, parameters[corner] - width, corner - 1)
        bend(corner, slopes[corner - 1], slopes[corner], width, half=False)
        begin = parameters[corner] + width
    end = parameters[-1] - (distances[0] if closed else 0.0)
    line(begin, end, last - 1)
    if closed:
        # The first half of the blend at the seam; it ends in the middle.
        bend(last, slopes[-1], slopes[0], distances[0], half=False)
    return PiecewisePolynomialCurve(
        [*starts, parameters[-1]], np.array(rows), closed=closed, known_smoothness=smoothness
    )


def blend_distances(points: np.ndarray, distance: float, *, closed: bool) -> np.ndarray:
    """Return half widths of the blends of a polygon: a distance, but at most half of a side.

    Args:
        points: Corners [n, dimension], m; if `closed`, the last is the first again.
        distance: Distance from the corner, m, positive.
        closed: True for a closed polygon.

    Returns:
        [n - 2], or [n - 1] beginning with the first corner if `closed`; m.

    Raises:
        InputError: a corner turns back by more than 170 degrees.
    """
    sides = np.diff(points, axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    before, after = sides[:-1], sides[1:]
    numbers = np.arange(2, len(points))
    shorter = np.minimum(lengths[:-1], lengths[1:])
    if closed:
        before, after = np.vstack([sides[-1:], before]), np.vstack([sides[:1], after])
        numbers = np.append(1, numbers)
        shorter = np.append(min(lengths[-1], lengths[0]), shorter)
    product = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    cosines = np.sum(before * after, axis=1) / product
    sharp = np.flatnonzero(cosines < math.cos(math.radians(_SHARPEST_DEG)))
    if sharp.size:
        turn = math.degrees(math.acos(max(-1.0, cosines[sharp[0]])))
        raise InputError(
            f"path.shape.corner_distance: the path turns by {turn:.1f} deg at waypoint"
            f" {numbers[sharp[0]]}; at most {_SHARPEST_DEG:g} deg can be rounded"
        )
    return np.minimum(distance, shorter / 2.0)


def _blend_integral(smoothness: int) -> np.ndarray:
    """Return the integral of the blend b over [0, 1] from 0 to s: coefficients of powers of s."""
    k = smoothness - 1
    rate = Polynomial([0.0, 1.0]) ** k * Polynomial([1.0, -1.0]) ** k
    blend = rate.integ()
    return np.array((blend / blend(1.0)).integ().coef, dtype=float)


def _of_second_half(coefficients: np.ndarray) -> np.ndarray:
    """Return coefficients of the same polynomial of s in powers of 2 s - 1."""
    moved = Polynomial(coefficients)(Polynomial([0.5, 0.5])).coef
    return np.pad(np.asarray(moved, dtype=float), (0, len(coefficients) - len(moved)))
