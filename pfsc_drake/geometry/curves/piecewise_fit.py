"""Adaptive piecewise polynomial approximation of functions."""

from collections.abc import Callable
from functools import cache

import numpy as np

from pfsc_drake.errors import InputError

_MAX_HALVINGS = 30
# About half a gigabyte of a path's table.
_MAX_PIECES = 200_000
_NEGLIGIBLE = 0.01
_ROUNDING = 1e-13


def power_coefficients(values: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return polynomials through values at the nodes of `chebyshev_nodes`.

    Args:
        values: [segments, degree + 1, dimension], at the nodes.
        lengths: Lengths of the segments, [segments].

    Returns:
        Coefficients of powers of (theta - theta_s), [segments, degree + 1, dimension].
    """
    count = values.shape[1]
    chebyshev, powers = _conversions(count)
    # In two steps: their product has large entries of both signs, which would cost digits.
    series = np.einsum("ij,sjd->sid", chebyshev, values)
    scaled = np.einsum("ij,sjd->sid", powers, series)
    return scaled / lengths[:, None, None] ** np.arange(count)[:, None]


def chebyshev_nodes(starts: np.ndarray, lengths: np.ndarray, count: int) -> np.ndarray:
    """Return the Chebyshev points of the first kind, all inside of their segments.

    Args:
        starts: Begin of each segment, [segments].
        lengths: Lengths of the segments, [segments].
        count: Number of points in each.

    Returns:
        Array [segments, count].
    """
    return starts[:, None] + lengths[:, None] * (1.0 + _chebyshev_points(count)) / 2.0


def fit_pieces(
    function: Callable[[np.ndarray], np.ndarray],
    breakpoints: np.ndarray,
    *,
    degree: int,
    tolerance: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Halve segments until a polynomial on each agrees with the function.

    The function is never evaluated at the ends of a segment, so it may jump there.

    Args:
        function: Maps parameters [m] to values [m, dimension].
        breakpoints: Ends of the intervals in which the function is smooth, [segments + 1].
        degree: Degree of the polynomials.
        tolerance: Largest deviation allowed, in units of the function. Larger ones pass
            on segments so short that the integral of the function does not feel them.

    Returns:
        Breakpoints [pieces + 1] and coefficients [pieces, degree + 1, dimension] in powers
        of (theta - theta_s).

    Raises:
        InputError: no agreement even on very short segments, or on as many as 200,000.
    """
    starts, lengths = breakpoints[:-1], np.diff(breakpoints)
    # Off the nodes, and close to the ends, where interpolation errors are largest.
    checks = np.array([0.004, 0.11, 0.37, 0.52, 0.71, 0.93, 0.996])
    # Rounding errors of the function itself do not get smaller with the segments.
    negligible = _NEGLIGIBLE * tolerance * (breakpoints[-1] - breakpoints[0])
    done: list[tuple[np.ndarray, np.ndarray]] = []
    found = 0
    for _ in range(_MAX_HALVINGS):
        nodes = chebyshev_nodes(starts, lengths, degree + 1)
        values = function(nodes.ravel()).reshape(*nodes.shape, -1)
        coefficients = power_coefficients(values, lengths)
        local = lengths[:, None] * checks
        truth = function((starts[:, None] + local).ravel()).reshape(*local.shape, -1)
        powers = local[..., None] ** np.arange(degree + 1)
        error = np.abs(powers @ coefficients - truth).max(axis=(1, 2))
        allowed = tolerance + _ROUNDING * np.abs(values).max(axis=(1, 2))
        good = (error <= allowed) | (error * lengths <= negligible)
        done.append((starts[good], coefficients[good]))
        found += int(np.count_nonzero(good))
        if found + 2 * np.count_nonzero(~good) > _MAX_PIECES:
            where = starts[0] if np.all(good) else starts[~good][0]
            raise InputError(
                f"curve: more than {_MAX_PIECES} polynomials are needed, near"
                f" theta = {where:.9g} and elsewhere; a smoother curve, or one of fewer"
                " segments, is required"
            )
        if np.all(good):
            pieces = np.concatenate([item[0] for item in done])
            order = np.argsort(pieces)
            table = np.concatenate([item[1] for item in done])[order]
            return np.append(pieces[order], breakpoints[-1]), table
        halves = lengths[~good] / 2.0
        starts = np.concatenate([starts[~good], starts[~good] + halves])
        lengths = np.concatenate([halves, halves])
    raise InputError(f"curve: not smooth near theta = {starts[0]:.9g}; a regular curve is required")


@cache
def _conversions(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return maps from values at `count` nodes to a Chebyshev series, and from there to powers."""
    nodes = _chebyshev_points(count)
    chebyshev = np.linalg.inv(np.polynomial.chebyshev.chebvander(nodes, count - 1))
    powers = np.zeros((count, count))
    for j in range(count):
        unit = np.polynomial.Chebyshev.basis(j, domain=[0.0, 1.0])
        powers[: j + 1, j] = unit.convert(kind=np.polynomial.Polynomial).coef
    return chebyshev, powers


@cache
def _chebyshev_points(count: int) -> np.ndarray:
    return np.polynomial.chebyshev.chebpts1(count)
