"""Surfaces fitted to scattered points, as people scan workpieces."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.checks import FARTHEST, SHORTEST
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.penalized_spline import PenalizedSpline
from pfsc_drake.geometry.curves.spline import UniformKnots, check_smoothness
from pfsc_drake.geometry.surfaces.choose_base import (
    BaseChoice,
    Neighbourhoods,
    choose_base,
    cover,
    neighbourhoods,
    stand,
)
from pfsc_drake.geometry.surfaces.fit_bases import Base
from pfsc_drake.geometry.surfaces.parametric_surface import Interval
from pfsc_drake.geometry.surfaces.penalized_surface import (
    Residuals,
    check_scatter,
    residuals,
    smoothest_within,
)
from pfsc_drake.geometry.surfaces.product import ProductSurface, uniform_spline_surface
from pfsc_drake.geometry.surfaces.regularity import sample_grid

FEWEST_POINTS, MOST_POINTS = 50, 100_000
# How far a place may be from the nearest point, over the distance at which points stand.
_REACH = 2.0
# Spacings per knot interval, and the most coefficients.
_SPACINGS, _MOST_COEFFICIENTS = 2.0, 2500.0
_FEWEST_INTERVALS = 8
# Least part of the rectangle around all points that is left of it.
_LEAST_PART = 0.25
# Cosine of the largest angle between normals of the surface and of its base.
_UPRIGHT = 0.15
_ERROR_SAMPLES = 24
# Standard error that is borne: so many times the noise, or spacings.
_NOISES, _ERROR_SPACINGS = 3.0, 0.02


@dataclass(frozen=True)
class ScatteredFitOptions:
    """How a surface is fitted to scattered points.

    Attributes:
        smoothness: k of the class C^k, 2..6.
        tolerance: Largest distance of a point from the surface, m: the smoothest surface is taken
            that misses none by more, and it follows the noise no closer than it must. None: the
            surface that predicts points best that it has not seen, judged by cross-validation.
        base: Over which surface the points are seen, see `choose_base`.
        seen_from: A point on the side that the normal points to, [3], m; by default upwards on
            a plane, and outward on a cylinder.
        along: Direction that theta_1 leans to, on a plane; by default the longer side.
        largest_hole: Largest distance of a place on the surface from the nearest point, m; by
            default twice the distance at which points stand, see `stand`.
        trim: Keep the largest rectangle of the parameters that has no larger hole, instead of
            refusing.
    """

    smoothness: int = 5
    tolerance: float | None = None
    base: BaseChoice = "auto"
    seen_from: ArrayLike | None = None
    along: ArrayLike | None = None
    largest_hole: float | None = None
    trim: bool = False


@dataclass(frozen=True)
class SurfaceFit:
    """A surface fitted to points, and how well.

    Attributes:
        surface: The surface, its parameters being lengths on the base, m.
        points: The points it is fitted to, those of the rectangle kept, [n, 3], m.
        residuals: Where they stand relative to the surface.
        base: What the points were projected on, for people.
        spacing: Distance at which points stand, m.
        hole: Largest distance of a place on the surface from the nearest point, m.
        hole_at: That place, [3], m.
        noise: Standard deviation of the points' noise along the normal as estimated from the
            residuals and the number of parameters that the fit has used up, m.
        uncertainty: Largest standard error of the surface along the base's normal that such
            noise and holes explain, m; a tolerance may cost more.
    """

    surface: ProductSurface
    points: np.ndarray
    residuals: Residuals
    base: str
    spacing: float
    hole: float
    hole_at: np.ndarray
    noise: float
    uncertainty: float


def fit_scattered(points: ArrayLike, options: ScatteredFitOptions | None = None) -> SurfaceFit:
    """Fit a surface to scattered points.

    The points are projected on a plane, or on a cylinder where they bend over; their heights over
    it are smoothed by a `PenalizedSpline`, with weights that make residuals distances along the
    normal of the surface instead of that of the base.

    Args:
        points: [n, 3], m, 50 to 100,000 different ones, in any order.
        options: How it is smoothed, and what is allowed.

    Returns:
        The surface and its residuals.

    Raises:
        InputError: Points that cannot be used, that fold over in every base, leave holes,
            stand off from the others or scatter by more than the tolerance.
    """
    options = options or ScatteredFitOptions()
    check_smoothness(options.smoothness)
    cloud = check_cloud(points)
    _check_length("tolerance", options.tolerance)
    _check_length("largest_hole", options.largest_hole)
    near = neighbourhoods(cloud)
    base = choose_base(cloud, near, options.base, options.seen_from, options.along)
    kept, domain, (centre, hole) = _covered(cloud, base, options)
    cloud = cloud[kept]
    theta = base.parameters(cloud)
    knots = _knots(domain, near.spacing, options.smoothness + 1, base.closed)
    spline = PenalizedSpline(theta, base.heights(cloud), *knots)

    def surface_of(coefficients: np.ndarray) -> ProductSurface:
        heights = coefficients.reshape(knots[0].count, knots[1].count)
        return uniform_spline_surface(*knots, base.coefficients(*knots, heights))

    exponent, _ = spline.best_predicting()
    slopes = _slopes(surface_of(spline.fit(exponent)), theta, base.normals(cloud))
    spline.weigh(slopes**2)
    exponent, noise = spline.best_predicting(exponent)
    uncertainty = _uncertainty(
        spline, exponent, noise, near, options.tolerance, lambda: surface_of(spline.fit(exponent))
    )
    if options.tolerance is None:
        coefficients = spline.fit(exponent)
    else:
        coefficients = smoothest_within(
            spline,
            exponent,
            options.tolerance,
            lambda found: np.abs(spline.residuals(found)) * slopes,
        )
    surface = surface_of(coefficients)
    _check_upright(surface, base)
    left = residuals(surface, cloud, theta)
    check_scatter(left, cloud, near.spacing, options.tolerance)
    hole_at = surface.partials(centre[None], 0)[0, 0]
    return SurfaceFit(
        surface, cloud, left, base.name, near.spacing, hole, hole_at, noise, uncertainty
    )


def check_cloud(points: ArrayLike) -> np.ndarray:
    """Return scattered points as an array [n, 3], m.

    Raises:
        InputError: Wrong shape, too few or too many, not finite, too far away, too small a
            patch, or points twice.
    """
    cloud = np.asarray(points, dtype=float)
    if cloud.ndim != 2 or cloud.shape[1] != 3:
        raise InputError(f"surface points: shape {cloud.shape}; [points, 3] is required")
    if not FEWEST_POINTS <= len(cloud) <= MOST_POINTS:
        raise InputError(
            f"surface points: {len(cloud)}; from {FEWEST_POINTS} to {MOST_POINTS} are required,"
            " evenly thinned out where there are more"
        )
    bad = np.argwhere(~(np.abs(cloud) <= FARTHEST))
    if bad.size:
        row, axis = bad[0]
        raise InputError(
            f"surface points: number {row + 1}, {'xyz'[axis]} = {cloud[row, axis]:g} m; a number"
            f" of at most {FARTHEST:g} is required"
        )
    size = float(np.linalg.norm(np.ptp(cloud, axis=0)))
    if not size >= SHORTEST:
        raise InputError(
            f"surface points: all within {size:.3g} m; at least {SHORTEST:g} m are required"
        )
    order = np.lexsort(cloud.T)
    same = np.flatnonzero(np.all(cloud[order[1:]] == cloud[order[:-1]], axis=1))
    if same.size:
        first, second = sorted((int(order[same[0]]), int(order[same[0] + 1])))
        raise InputError(
            f"surface points: numbers {first + 1} and {second + 1} are the same,"
            f" {cloud[first].tolist()} m; {len(same)} points are there twice: leave them out"
        )
    return cloud


def _covered(
    points: np.ndarray, base: Base, options: ScatteredFitOptions
) -> tuple[np.ndarray, tuple[Interval, Interval], tuple[np.ndarray, float]]:
    """Which points are kept, the rectangle of parameters, and its largest hole, see `Coverage`."""
    theta = base.parameters(points)
    low, high = theta.min(axis=0), theta.max(axis=0)
    domain = (Interval(*_floats(low[0], high[0])), Interval(*_floats(low[1], high[1])))
    if base.closed[0]:
        domain = (Interval(0.0, base.period), domain[1])
    area = domain[0].length * domain[1].length
    reach = options.largest_hole or _REACH * stand(theta)
    coverage = cover(theta, domain, reach, closed=base.closed[0])
    centre, radius = coverage.hole
    if radius <= reach:
        return np.full(len(points), True), domain, coverage.hole
    if not options.trim:
        nearest = points[int(np.argmin(np.linalg.norm(theta - centre, axis=1)))]
        raise InputError(
            f"surface points: no point within {radius:.3g} m of theta = [{centre[0]:.4g},"
            f" {centre[1]:.4g}] m, near the point [{nearest[0]:.4g}, {nearest[1]:.4g},"
            f" {nearest[2]:.4g}] m, of a patch of {domain[0].length:.3g} by"
            f" {domain[1].length:.3g} m; at most {reach:.3g} m are allowed (largest_hole): scan"
            " the place, or trim the patch"
        )
    part = coverage.covered(reach, domain, base.closed[0])
    if part is None or part[0].length * part[1].length < _LEAST_PART * area:
        raise InputError(
            f"surface points: holes of up to {radius:.3g} m leave no rectangle of a quarter of"
            f" the patch; at most {reach:.3g} m are allowed (largest_hole)"
        )
    inside = [(theta[:, k] >= part[k].begin) & (theta[:, k] <= part[k].end) for k in (0, 1)]
    kept = inside[0] & inside[1]
    if np.count_nonzero(kept) < FEWEST_POINTS:
        raise InputError(
            f"surface points: {np.count_nonzero(kept)} are left in the covered rectangle;"
            f" at least {FEWEST_POINTS} are required"
        )
    hole = cover(theta, part, reach, closed=base.closed[0]).hole
    return kept, part, hole


def _knots(
    domain: tuple[Interval, Interval], spacing: float, degree: int, closed: tuple[bool, bool]
) -> tuple[UniformKnots, UniformKnots]:
    """Knots so near to each other that the penalty alone says how smooth the surface is."""
    sides = [side.length for side in domain]
    step = max(_SPACINGS * spacing, math.sqrt(sides[0] * sides[1] / _MOST_COEFFICIENTS))
    first, second = (
        UniformKnots(*side, max(_FEWEST_INTERVALS, round(side.length / step)), degree, around)
        for side, around in zip(domain, closed, strict=True)
    )
    return first, second


def _slopes(surface: ProductSurface, theta: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Cosines of angles between the surface's normals and directions [n, 3], [n]."""
    first, second = np.moveaxis(surface.partials(theta, 1)[:, 1:], 1, 0)
    normals = np.cross(first, second)
    return np.abs(np.sum(normals * directions, axis=1)) / np.linalg.norm(normals, axis=1)


def _uncertainty(
    spline: PenalizedSpline,
    exponent: float,
    noise: float,
    near: Neighbourhoods,
    tolerance: float | None,
    estimate: Callable[[], ProductSurface],
) -> float:
    """Largest standard error of heights; refuses what the points leave open."""
    sides = [np.linspace(knots.begin, knots.end, _ERROR_SAMPLES) for knots in spline.knots]
    theta = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)
    errors = noise * spline.standard_errors(theta, exponent)
    worst = int(np.argmax(errors))
    allowed = max(_NOISES * noise, _ERROR_SPACINGS * near.spacing, tolerance or 0.0)
    if errors[worst] > allowed:
        x, y, z = estimate().partials(theta[[worst]], 0)[0, 0]
        raise InputError(
            "surface points: do not determine the surface near"
            f" [{x:.4g}, {y:.4g}, {z:.4g}] m, at its edge or in a hole: its standard error there is"
            f" {errors[worst]:.2g} m, where {allowed:.2g} m are allowed. Points scatter by"
            f" {noise:.2g} m about the smooth surface that predicts them best: if that is more than"
            " the scanner's noise, the workpiece has a step or an edge, which no smooth surface"
            " follows: fit a part of it; else scan the place, or trim the patch with a smaller"
            " largest_hole"
        )
    return float(errors[worst])


def _check_upright(surface: ProductSurface, base: Base) -> None:
    """Refuse a surface that is not regular, or nearly falls over its base."""
    grid = sample_grid(surface)
    normals = base.normals(grid.position.reshape(-1, 3))
    cosines = np.sum(grid.normal.reshape(-1, 3) * normals, axis=1)
    worst = int(np.argmin(cosines))
    if cosines[worst] < _UPRIGHT:
        raise InputError(
            "surface points: the surface fitted leans over by"
            f" {math.degrees(math.acos(max(-1.0, cosines[worst]))):.0f} deg on {base.name} near"
            f" {np.round(grid.position.reshape(-1, 3)[worst], 4).tolist()} m; at most"
            f" {math.degrees(math.acos(_UPRIGHT)):.0f} are allowed: leave this part out, or give"
            " another base"
        )


def _check_length(name: str, value: float | None) -> None:
    if value is not None and not 0.0 < value < math.inf:
        raise InputError(f"{name}: {value} m; a positive number is required")


def _floats(*values: float) -> list[float]:
    return [float(value) for value in values]
