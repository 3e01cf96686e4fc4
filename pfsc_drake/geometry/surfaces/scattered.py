"""Surfaces fitted to scattered points, such as scans of workpieces."""

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
# Largest distance to the nearest point, relative to the spacing of points.
_REACH = 2.0
# Spacings per knot interval, and the most coefficients.
_SPACINGS, _MOST_COEFFICIENTS = 2.0, 2500.0
_FEWEST_INTERVALS = 8
# Smallest remaining part of the rectangle around all points.
_LEAST_PART = 0.25
# Cosine of the largest angle between normals of the surface and of its base.
_UPRIGHT = 0.15
_ERROR_SAMPLES = 24
# Largest tolerated standard error: multiples of the noise, or of the spacing.
_NOISES, _ERROR_SPACINGS = 3.0, 0.02


@dataclass(frozen=True)
class ScatteredFitOptions:
    """Options of a surface fit to scattered points.

    Attributes:
        smoothness: k of the class C^k, 2..6.
        tolerance: Largest distance of a point from the surface, m: the smoothest surface within it
            is taken, which follows the noise no closer than necessary. None: the surface that
            predicts left-out points best, by cross-validation.
        base: Surface that the points are projected onto, see `choose_base`.
        visible_from: A point on the side that the normal points to, [3], m; by default upwards on
            a plane, and outward on a cylinder.
        along: Direction that theta_1 leans to, on a plane; by default the longer side.
        largest_hole: Largest distance on the surface to the nearest point, m; by default twice the
            spacing of points, see `stand`.
        trim: Use the largest rectangle of the parameters that has no larger hole, instead of
            refusing.
    """

    smoothness: int = 5
    tolerance: float | None = None
    base: BaseChoice = "auto"
    visible_from: ArrayLike | None = None
    along: ArrayLike | None = None
    largest_hole: float | None = None
    trim: bool = False


@dataclass(frozen=True)
class SurfaceFit:
    """Surface fitted to points, and the quality of the fit.

    Attributes:
        surface: The surface, its parameters being lengths on the base, m.
        points: The fitted points, within the selected rectangle, [n, 3], m.
        residuals: Their positions relative to the surface.
        base: Name of the base that the points were projected onto.
        spacing: Spacing of the points, m.
        hole: Largest distance on the surface to the nearest point, m.
        hole_at: Centre of that hole, [3], m.
        noise: Standard deviation of the points' noise along the normal, estimated from the
            residuals and the effective number of parameters of the fit, m.
        uncertainty: Largest standard error of the surface along the base's normal due to noise and
            holes, m; a tolerance may increase it.
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
    normal of the surface instead of the base's.

    Args:
        points: [n, 3], m, 50 to 100,000 different ones, in any order.
        options: Smoothing and limits.

    Returns:
        The surface and its residuals.

    Raises:
        InputError: Points that cannot be used, that fold over in every base, leave holes,
            lie off the others or scatter by more than the tolerance.
    """
    options = options or ScatteredFitOptions()
    check_smoothness(options.smoothness)
    cloud = check_cloud(points)
    _check_length("tolerance", options.tolerance)
    _check_length("largest_hole", options.largest_hole)
    near = neighbourhoods(cloud)
    base = choose_base(cloud, near, options.base, options.visible_from, options.along)
    selected, domain, (centre, hole) = _select(cloud, base, options)
    cloud = cloud[selected]
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


def _select(
    points: np.ndarray, base: Base, options: ScatteredFitOptions
) -> tuple[np.ndarray, tuple[Interval, Interval], tuple[np.ndarray, float]]:
    """Return the selected points, the rectangle of parameters, and its hole, see `Coverage`."""
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
    part = coverage.covered_rectangle(reach, domain, base.closed[0])
    if part is None or part[0].length * part[1].length < _LEAST_PART * area:
        raise InputError(
            f"surface points: holes of up to {radius:.3g} m leave no rectangle of a quarter of"
            f" the patch; at most {reach:.3g} m are allowed (largest_hole)"
        )
    inside = [(theta[:, k] >= part[k].begin) & (theta[:, k] <= part[k].end) for k in (0, 1)]
    selected = inside[0] & inside[1]
    if np.count_nonzero(selected) < FEWEST_POINTS:
        raise InputError(
            f"surface points: {np.count_nonzero(selected)} are left in the covered rectangle;"
            f" at least {FEWEST_POINTS} are required"
        )
    hole = cover(theta, part, reach, closed=base.closed[0]).hole
    return selected, part, hole


def _knots(
    domain: tuple[Interval, Interval], spacing: float, degree: int, closed: tuple[bool, bool]
) -> tuple[UniformKnots, UniformKnots]:
    """Return knots so dense that the penalty alone determines the smoothness."""
    sides = [side.length for side in domain]
    step = max(_SPACINGS * spacing, math.sqrt(sides[0] * sides[1] / _MOST_COEFFICIENTS))
    first, second = (
        UniformKnots(*side, max(_FEWEST_INTERVALS, round(side.length / step)), degree, around)
        for side, around in zip(domain, closed, strict=True)
    )
    return first, second


def _slopes(surface: ProductSurface, theta: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return cosines of angles between the surface's normals and directions [n, 3], [n]."""
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
    """Return the largest standard error of heights; refuse undetermined surfaces."""
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
    """Refuse a surface that is not regular, or nearly perpendicular to its base."""
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
