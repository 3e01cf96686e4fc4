"""Smooth surfaces near a grid of noisy points."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.grid import grid_for, grid_parameters
from pfsc_drake.geometry.surfaces.penalized_surface import PenalizedSurface, Residuals, residuals
from pfsc_drake.geometry.surfaces.product import ProductSurface
from pfsc_drake.geometry.surfaces.regularity import check_regular
from pfsc_drake.geometry.surfaces.spline_surface import UniformKnots, uniform_spline_surface

# Points out of the tolerance pull harder until they are in.
_PULLS, _LEAST_PULL, _STRONGEST = 60, 1.5, 1e9
_INSIDE = 0.995
# Part of all points that may be pulled: more are not stray, but the noise.
_FEW = 0.05


def smoothest_within(
    spline: PenalizedSurface,
    exponent: float,
    tolerance: float,
    distances: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """The smoothest penalized spline that misses no point by more than a tolerance.

    The penalty is the strongest that leaves all distances within it, but not weaker than the one
    that suits the noise: fitting more closely would follow that. Points that are still outside
    then get larger weights, if they are few.

    Args:
        spline: What is fitted; its weights may be changed.
        exponent: Decimal logarithm of the roughness that suits the noise, see
            `PenalizedSurface.best_predicting`.
        tolerance: Largest distance allowed, m.
        distances: Maps coefficients to the distances of all points, [n], m.

    Returns:
        Coefficients of the spline.

    Raises:
        InputError: Some point is further away even so, or one in twenty before weights.
    """

    def near(found: np.ndarray) -> bool:
        return bool(distances(found).max() <= _INSIDE * tolerance)

    coefficients = spline.fit(exponent)
    attainable = float(distances(coefficients).max())
    if near(coefficients):
        return spline.fit(spline.strongest(near, exponent))
    weights = spline.weights.copy()
    few = np.mean(distances(coefficients) > tolerance) <= _FEW
    for _ in range(_PULLS if few else 0):
        missed = distances(coefficients)
        outside = missed > _INSIDE * tolerance
        if not np.any(outside):
            return coefficients
        pull = np.maximum(_LEAST_PULL, (missed[outside] / tolerance) ** 2)
        weights[outside] = np.minimum(weights[outside] * pull, _STRONGEST)
        spline.weigh(weights)
        coefficients = spline.fit(exponent)
    missed = distances(coefficients)
    worst = int(np.argmax(missed))
    digits = 1 - math.floor(math.log10(attainable))
    enough = math.ceil(1.05 * attainable * 10.0**digits) / 10.0**digits
    raise InputError(
        f"tolerance: {tolerance:g} m: the points scatter more about every smooth surface, which"
        f" misses number {worst + 1} of those fitted by {missed[worst]:.3g} m: allow {enough:g} m,"
        " or take that point out"
    )


MOST_POINTS = 100_000
_MOST_INTERVALS, _FEWEST_INTERVALS = 60, 6


def smooth_surface_near_grid(
    points: ArrayLike,
    *,
    smoothness: int,
    tolerance: float | None,
    closed: tuple[bool, bool] = (False, False),
) -> tuple[ProductSurface, Residuals]:
    """The smoothest spline surface near a grid of points.

    Its parameters are those of `surface_through_grid`. Unlike surfaces fitted to scattered points
    it may bend over as it likes, and close in both directions.

    Args:
        points: As for `surface_through_grid`, 100,000 at most.
        smoothness: k of the class C^k, 2..6.
        tolerance: Largest distance of a point from the surface along its normal, m, see
            `smoothest_within`; None for the surface that predicts points best.
        closed: Which directions are periodic.

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
    spline = PenalizedSurface(theta, cloud - centre, first, second)

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
