"""Smooth paths through noisy waypoints."""

import math
from collections.abc import Callable

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.orientation_curve import OrientationCurve, check_neighbours
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.curves.smoothing import SmoothFit, noise_level, smoothest_within
from pfsc_drake.geometry.progress import Progress

# Points nearer than this many tolerances do not determine the path between them.
_STRIDE = 3.0
_ROUNDS = 3
_PROJECTION_STEPS = 3
_LENGTH_SAMPLES = 16
_FEWEST_CLOSED = 4


def smooth_positions(
    points: np.ndarray,
    *,
    smoothness: int,
    tolerance: float,
    closed: bool,
    progress: Progress | None = None,
) -> tuple[PiecewisePolynomialCurve, np.ndarray]:
    """Return the smoothest curve near noisy points, see `smoothest_within`.

    Its parameter is approximately the arc length: the first guess uses points far enough apart
    for the noise to be negligible, then each point gets the arc length of its projection.

    Args:
        points: [n, 3], m; neighbours may coincide. A closed curve returns from the last to
            the first.
        smoothness: k of the class C^k.
        tolerance: Largest distance of a point from the curve, m.
        closed: True for a closed curve.
        progress: Callback with the fraction done and the name of the step.

    Returns:
        The curve on [0, theta_1], and theta of the points, [n].

    Raises:
        InputError: too few different points, or no curve is near enough.
    """
    degree = smoothness + 1
    needed = _FEWEST_CLOSED if closed else degree + 1
    distinct = 1 + int(np.count_nonzero(np.any(np.diff(points, axis=0), axis=1)))
    if distinct < needed:
        raise InputError(
            f"waypoints: {distinct} different; at least {needed} are needed for class"
            f" C^{smoothness}"
        )
    theta, end = _accumulate_strides(points, _STRIDE * tolerance, closed)

    def fit(theta: np.ndarray, end: float) -> SmoothFit:
        order = np.argsort(theta, kind="stable")
        return smoothest_within(
            theta,
            points,
            end,
            degree=degree,
            closed=closed,
            tolerance=tolerance,
            noise=noise_level(theta[order], points[order], across=True),
            deviation=lambda values: np.asarray(np.linalg.norm(values - points, axis=1)),
        )

    found = fit(theta, end)
    for done in range(_ROUNDS):
        if progress is not None:
            progress((done + 1.0) / (_ROUNDS + 1.0), "smoothing the waypoints")
        theta, end = _arc_lengths(found.curve, _closest_parameters(found.curve, theta, points))
        found = fit(theta, end)
    _require_near(
        found,
        "path.shape.tolerance",
        tolerance,
        (1.0, "m"),
        lambda enough: allows_tolerance(points, enough, closed),
    )
    return found.curve, theta


def smooth_orientation(
    quaternions: np.ndarray,
    parameters: np.ndarray,
    end: float,
    *,
    smoothness: int,
    tolerance: float,
    closed: bool,
) -> OrientationCurve:
    """Return the smoothest orientation near noisy ones, see `smoothest_within`.

    Args:
        quaternions: (w, x, y, z), [n, 4], of length one.
        parameters: theta of each, [n], within [0, end].
        end: End of the domain, or of the first period if `closed`.
        smoothness: k of the class C^k.
        tolerance: Largest angle between an orientation and the curve there, rad.
        closed: True if it is periodic.

    Returns:
        The curve; its period is two revolutions if the quaternion returns with its sign flipped.

    Raises:
        InputError: neighbours are more than 170 degrees apart, or no curve is near enough.
    """
    order = np.argsort(parameters, kind="stable")
    theta, q = parameters[order], check_neighbours(quaternions[order])
    if closed and q[-1] @ q[0] < 0.0:
        theta, q, end = np.concatenate([theta, theta + end]), np.vstack([q, -q]), 2.0 * end

    def angles(values: np.ndarray) -> np.ndarray:
        # The angle between quaternions is half of it; atan2 preserves the digits of small angles.
        along = np.sum(values * q, axis=1)
        across = np.linalg.norm(values - along[:, None] * q, axis=1)
        return np.asarray(2.0 * np.arctan2(across, along))

    found = smoothest_within(
        theta,
        q,
        end,
        degree=smoothness + 1,
        closed=closed,
        tolerance=tolerance,
        noise=2.0 * noise_level(theta, q, across=False),
        deviation=angles,
    )
    unit = (180.0 / math.pi, "deg")
    largest = 90.0  # deg, of the key
    _require_near(found, "path.shape.tolerance_deg", tolerance, unit, lambda a: a <= largest)
    return OrientationCurve(found.curve)


def allows_tolerance(points: np.ndarray, tolerance: float, closed: bool) -> bool:
    """Return whether points reach far enough for a path that may miss them by a tolerance.

    Args:
        points: [n, 3], m.
        tolerance: m.
        closed: True for a closed path.
    """
    try:
        _accumulate_strides(points, _STRIDE * tolerance, closed)
    except InputError:
        return False
    return True


def _require_near(
    found: SmoothFit,
    key: str,
    tolerance: float,
    unit_of: tuple[float, str],
    is_allowed: Callable[[float], bool],
) -> None:
    """Refuse a curve that is not near enough, and propose a sufficient tolerance if possible."""
    scale, unit = unit_of
    worst = int(np.argmax(found.deviations))
    if found.deviations[worst] > tolerance:
        enough = max(found.attainable, tolerance) * scale
        digits = 1 - math.floor(math.log10(enough))
        enough = math.ceil(1.02 * enough * 10.0**digits) / 10.0**digits
        raise InputError(
            f"{key} = {tolerance * scale:g} {unit}: the waypoints scatter more about every smooth"
            f" curve, which misses number {worst + 1} by"
            f" {found.deviations[worst] * scale:.3g} {unit}:"
            f" {f'allow {enough:g} {unit}, or ' if is_allowed(enough) else ''}take that point out"
        )


def _accumulate_strides(
    points: np.ndarray, stride: float, closed: bool
) -> tuple[np.ndarray, float]:
    """Return lengths along the polygon of points that are a stride apart: theta [n], and its end.

    The points between are projected on their side of the polygon.
    """
    rows = [0]
    x, y, z = points[0].tolist()
    square = stride * stride
    for row, (u, v, w) in enumerate(points.tolist()):
        if (u - x) ** 2 + (v - y) ** 2 + (w - z) ** 2 >= square:
            rows.append(row)
            x, y, z = u, v, w
    while closed and len(rows) > 1 and np.linalg.norm(points[rows[-1]] - points[0]) < stride:
        rows.pop()
    if closed:
        corners = points[[*rows, 0]]
    else:
        if len(rows) > 1:
            rows.pop()
        corners = points[[*rows, len(points) - 1]]
    sides = np.diff(corners, axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    if len(rows) < 2 or not np.all(lengths > 0.0):
        raise InputError(
            f"path.shape.tolerance: {stride / _STRIDE:g} m is too much for a path whose waypoints"
            f" reach {np.linalg.norm(points - points[0], axis=1).max():.3g} m from the first"
        )
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    side = np.searchsorted(rows, np.arange(len(points)), side="right") - 1
    along = np.sum((points - corners[side]) * sides[side], axis=1) / lengths[side]
    theta = starts[side] + np.clip(along, 0.0, lengths[side])
    if not closed:
        theta[-1] = starts[-1]
    return theta, float(starts[-1])


def _closest_parameters(curve: Curve, theta: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the parameters of the curve's closest points to points, near a guess."""
    begin, end = curve.domain
    longest = 2.0 * float(np.diff(curve.breakpoints).max())
    for _ in range(_PROJECTION_STEPS):
        values = curve.derivatives(theta, 1)
        slope = values[:, 1]
        step = np.sum((points - values[:, 0]) * slope, axis=1) / np.sum(slope**2, axis=1)
        theta = theta + np.clip(step, -longest, longest)
        if not curve.closed:
            theta = np.clip(theta, begin, end)
    if not curve.closed:
        theta[0], theta[-1] = begin, end
    return theta


def _arc_lengths(curve: Curve, theta: np.ndarray) -> tuple[np.ndarray, float]:
    """Return arc lengths at parameters, from the first of a closed curve on, and the length."""
    count = _LENGTH_SAMPLES * (len(curve.breakpoints) - 1)
    grid = np.linspace(*curve.domain, count + 1)
    speed = np.linalg.norm(curve.derivatives(grid, 1)[:, 1], axis=1)
    steps = (speed[1:] + speed[:-1]) / 2.0 * np.diff(grid)
    lengths = np.concatenate([[0.0], np.cumsum(steps)])
    total = float(lengths[-1])
    if not curve.closed:
        return np.interp(theta, grid, lengths), total
    found = np.interp(curve.wrap(theta), grid, lengths)
    return np.mod(found - found[0], total), total
