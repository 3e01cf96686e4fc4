"""Surfaces through a grid of points, or near one of noisy points."""

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.checks import FARTHEST, SHORTEST
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.penalized_spline import PenalizedSpline
from pfsc_drake.geometry.curves.spline import UniformKnots, check_smoothness
from pfsc_drake.geometry.surfaces.penalized_surface import Residuals, residuals, smoothest_within
from pfsc_drake.geometry.surfaces.product import (
    ProductSurface,
    interpolated_surface,
    uniform_spline_surface,
)
from pfsc_drake.geometry.surfaces.regularity import check_regular

# Points of a closed direction.
_FEWEST_CLOSED = 3
# Neighbours closer than this part of the grid's length are one point.
_COINCIDENT = 1e-9


def surface_through_grid(
    points: ArrayLike, *, smoothness: int, closed: tuple[bool, bool] = (False, False)
) -> ProductSurface:
    """Return a spline surface of degree smoothness + 1 through all points of a grid.

    Its parameters are lengths: theta_1 grows by the mean distance between points of neighbouring
    rows, and theta_2 likewise between columns, so that both tangents have a length near one.

    Args:
        points: [n_1, n_2, 3], m, by theta_1 and theta_2; the last row or column of a closed
            direction may repeat the first.
        smoothness: k of the class C^k, 2..6.
        closed: Whether each direction is periodic.

    Returns:
        The surface, on [0, length] in both directions.

    Raises:
        InputError: Wrong shape, values that are not finite or too large, too few points,
            neighbours that coincide, or a surface that is not regular.
    """
    grid = grid_for(points, smoothness, closed)
    parameters = grid_parameters(grid, closed)
    surface = interpolated_surface(parameters, grid, smoothness + 1, closed)
    check_regular(surface)
    return surface


def grid_for(points: ArrayLike, smoothness: int, closed: tuple[bool, bool]) -> np.ndarray:
    """Return a grid of points as an array, with the first row and column again where it closes.

    Args:
        points: [n_1, n_2, 3], m.
        smoothness: k of the requested class C^k.
        closed: Whether each direction is periodic.

    Raises:
        InputError: As `surface_through_grid`.
    """
    check_smoothness(smoothness)
    grid = _check_points(points)
    for axis in (0, 1):
        if closed[axis]:
            grid = _append_first(grid, axis)
        needed = _FEWEST_CLOSED + 1 if closed[axis] else smoothness + 2
        if grid.shape[axis] < needed:
            raise InputError(
                f"grid of points: {grid.shape[axis] - closed[axis]} along theta_{axis + 1},"
                f" {'a closed' if closed[axis] else 'an open'} direction;"
                f" {needed - closed[axis]} are needed for class C^{smoothness}"
            )
    return grid


def _check_points(points: ArrayLike) -> np.ndarray:
    """Return a grid of points as an array [n_1, n_2, 3], m.

    Raises:
        InputError: Wrong shape, not finite, or beyond 1e4 m.
    """
    grid = np.asarray(points, dtype=float)
    if grid.ndim != 3 or grid.shape[2] != 3 or min(grid.shape[:2]) < 2:
        raise InputError(
            f"grid of points: shape {grid.shape}; [rows, columns, 3], two or more of each, is"
            " required"
        )
    bad = np.argwhere(~(np.abs(grid) <= FARTHEST))
    if bad.size:
        row, column, axis = bad[0]
        raise InputError(
            f"grid of points: row {row + 1}, column {column + 1}, {'xyz'[axis]} ="
            f" {grid[row, column, axis]:g} m; a number of at most {FARTHEST:g} is required"
        )
    return grid


def grid_parameters(grid: np.ndarray, closed: tuple[bool, bool]) -> tuple[np.ndarray, np.ndarray]:
    """Return parameters of a grid's rows and columns, from 0, by their mean distances.

    Args:
        grid: [n_1, n_2, 3], m, as `grid_for` returns it.
        closed: Whether each direction is periodic.

    Returns:
        theta_1 [n_1] and theta_2 [n_2], m, strictly increasing.

    Raises:
        InputError: Neighbours coincide, or all lie within 0.1 mm.
    """
    # Points repeated at both ends of a closed direction count once.
    once = grid[: len(grid) - closed[0]], grid[:, : grid.shape[1] - closed[1]]
    return _lengths(once[1], 0), _lengths(once[0], 1)


def _lengths(grid: np.ndarray, axis: int) -> np.ndarray:
    """Return the accumulated mean distances along an axis, [n_axis], m."""
    chords = np.linalg.norm(np.diff(grid, axis=axis), axis=2)
    total = float(chords.mean(axis=1 - axis).sum())
    if not total >= SHORTEST:
        raise InputError(
            f"grid of points: {total:.3g} m long along theta_{axis + 1}; at least {SHORTEST:g} m"
            " are required"
        )
    if not np.all(chords > _COINCIDENT * total):
        row, column = np.unravel_index(int(np.argmin(chords)), chords.shape)
        raise InputError(
            f"grid of points: row {row + 1}, column {column + 1} coincides with the next along"
            f" theta_{axis + 1}, {grid[row, column].tolist()} m; neighbours must differ (leave"
            " out poles)"
        )
    return np.concatenate([[0.0], np.cumsum(chords.mean(axis=1 - axis))])


def _append_first(grid: np.ndarray, axis: int) -> np.ndarray:
    """Return the grid with its first row or column again at the end, if it is not there."""
    first, last = (np.take(grid, [index], axis=axis) for index in (0, -1))
    if np.linalg.norm(last - first, axis=2).max() <= _COINCIDENT * np.ptp(grid):
        return np.concatenate([np.delete(grid, -1, axis=axis), first], axis=axis)
    return np.concatenate([grid, first], axis=axis)


MOST_POINTS = 100_000
_MOST_INTERVALS, _FEWEST_INTERVALS = 60, 6


def smooth_surface_near_grid(
    points: ArrayLike,
    *,
    smoothness: int,
    tolerance: float | None,
    closed: tuple[bool, bool] = (False, False),
) -> tuple[ProductSurface, Residuals]:
    """Return the smoothest spline surface near a grid of points.

    Its parameters are those of `surface_through_grid`. Unlike surfaces fitted to scattered points
    it may bend over arbitrarily, and close in both directions.

    Args:
        points: As for `surface_through_grid`, 100,000 at most.
        smoothness: k of the class C^k, 2..6.
        tolerance: Largest distance of a point from the surface along its normal, m, see
            `smoothest_within`; None for the surface that predicts points best.
        closed: Whether each direction is periodic.

    Returns:
        The surface, and the residuals of the points row by row.

    Raises:
        InputError: As `surface_through_grid`; or some point exceeds the tolerance.
    """
    grid = grid_for(points, smoothness, closed)
    parameters = grid_parameters(grid, closed)
    if grid.shape[0] * grid.shape[1] > MOST_POINTS:
        raise InputError(
            f"grid of points: {grid.shape[0]} x {grid.shape[1]}; at most {MOST_POINTS} points can"
            " be smoothed"
        )
    first, second = (
        UniformKnots(
            0.0,
            float(theta[-1]),
            int(np.clip(len(theta) - 1, _FEWEST_INTERVALS, _MOST_INTERVALS)),
            smoothness + 1,
            around,
        )
        for theta, around in zip(parameters, closed, strict=True)
    )
    # The end of a closed direction is its beginning.
    sides = [
        theta[:-1] if around else theta for theta, around in zip(parameters, closed, strict=True)
    ]
    theta = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)
    cloud = grid[: len(sides[0]), : len(sides[1])].reshape(-1, 3)
    centre = cloud.mean(axis=0)
    spline = PenalizedSpline(theta, cloud - centre, first, second)

    def surface_of(coefficients: np.ndarray) -> ProductSurface:
        table = coefficients.reshape(first.count, second.count, 3) + centre
        return uniform_spline_surface(first, second, table)

    exponent, _ = spline.best_predicting()
    coefficients = spline.fit(exponent)
    surface = surface_of(coefficients)
    if tolerance is not None:
        first_rows = surface.partials(theta, 1)
        normals = np.cross(first_rows[:, 1], first_rows[:, 2])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        coefficients = smoothest_within(
            spline,
            exponent,
            tolerance,
            lambda found: np.abs(np.sum(spline.residuals(found) * normals, axis=1)),
        )
        surface = surface_of(coefficients)
    check_regular(surface)
    return surface, residuals(surface, cloud, theta)
