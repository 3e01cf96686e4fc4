"""Curves through waypoints on a surface, and the orientation that its frame gives them."""

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.orientation import OrientationCurve, interpolate_orientation
from pfsc_drake.geometry.curves.spline import accumulate, close_polygon, interpolate_at
from pfsc_drake.geometry.rotation import (
    check_rotation_matrix,
    matrix_to_quaternion,
    quaternion_to_matrix,
)
from pfsc_drake.geometry.surfaces.frame import surface_axes
from pfsc_drake.geometry.surfaces.start import GlobalProjector
from pfsc_drake.geometry.surfaces.surface import Surface

# rad, between the frame and the spline through it
_FAITHFUL = 1e-6
_KEYFRAMES_PER_SEGMENT = (4, 8, 16, 32, 64)


def project_waypoints(
    surface: Surface, positions: np.ndarray, farthest: float, *, closed: bool
) -> np.ndarray:
    """Parameters of the places of a surface that are nearest to waypoints.

    In closed directions neighbours are less than half a period apart.

    Args:
        surface: Surface of class C^2.
        positions: Waypoints [n, 3], m.
        farthest: Largest distance from the surface that is taken for rounding or noise, m.
        closed: Whether the curve through them is closed.

    Returns:
        Parameters [n, 2].

    Raises:
        InputError: A waypoint is farther away, beside the patch, or nearly as near to another
            sheet; or a closed curve leads round a closed direction of the surface.
    """
    projector = GlobalProjector(surface)
    thetas = np.empty((len(positions), 2))
    for row, position in enumerate(positions):
        try:
            foot = projector.project(position)
        except InputError as error:
            raise InputError(f"waypoint {row} (from 0): {error}") from None
        if foot.distance > farthest:
            beside = ", beside its border" if foot.at_border else ""
            raise InputError(
                f"waypoint {row} (from 0): {position.tolist()} m is {1e3 * foot.distance:.3g} mm"
                f" from the surface{beside}; at most {1e3 * farthest:.3g} mm is allowed"
            )
        thetas[row] = foot.theta
    for k, ends in enumerate(surface.domain):
        if not surface.closed[k]:
            continue
        thetas[:, k] = np.unwrap(thetas[:, k], period=ends.length)
        if closed and abs(thetas[-1, k] - thetas[0, k]) > 0.5 * ends.length:
            raise InputError(
                f"waypoints lead round the surface in theta_{k + 1}, from {thetas[0, k]:.6g} to"
                f" {thetas[-1, k]:.6g}; a closed curve must come back to the same theta: leave it"
                " open, with as many laps as are needed"
            )
    return thetas


def curve_through(
    surface: Surface, thetas: ArrayLike, *, smoothness: int, closed: bool = False
) -> Curve:
    """Spline through waypoints in a surface's parameters, over the length of their polygon.

    Args:
        surface: The surface.
        thetas: Parameters [n, 2] of the waypoints; in closed directions they may lead on and on.
        smoothness: k of the class C^k, 2..6. Few waypoints of an open curve are joined by one
            polynomial, which has all derivatives; two by a straight line in the parameters.
        closed: Whether it leads back to the first, which may be repeated.

    Returns:
        Curve of dimension 2; its parameter is the length of the chords in space, m.

    Raises:
        InputError: Waypoints off the patch, too few, or neighbours that coincide.
    """
    points = np.asarray(thetas, dtype=float)
    fewest = 3 if closed else 2
    if points.ndim != 2 or points.shape[1:] != (2,) or len(points) < fewest:
        raise InputError(
            f"waypoints on a surface: shape {points.shape}; {fewest} or more pairs"
            " (theta_1, theta_2) are required"
        )
    polygon, _ = close_polygon(points, closed)
    if closed and len(polygon) <= fewest:
        raise InputError(f"waypoints: {len(polygon) - 1} distinct for a closed curve; at least 3")
    surface.checked(polygon)
    _, chords = close_polygon(surface.partials(polygon, 0)[:, 0], closed=False)
    degree = smoothness + 1 if closed else min(smoothness + 1, len(polygon) - 1)
    return interpolate_at(accumulate(chords, "chord"), polygon, degree, closed=closed)


def normal_orientation(
    surface: Surface, parameters: Curve, offset: np.ndarray, *, smoothness: int
) -> OrientationCurve:
    """Orientation along a curve that turns with the surface's frame.

    ``R_d = [t_1, e_perp x t_1, e_perp] offset`` (4.2), (4.3), through as many keyframes as keep
    within 1e-6 rad of it.

    Args:
        surface: The surface.
        parameters: Curve in its parameters, of dimension 2, on the surface.
        offset: Constant rotation matrix, [3, 3].
        smoothness: k of the class C^k, 2..6.

    Raises:
        InputError: The offset is no rotation, or the frame turns too quickly.
    """
    check_rotation_matrix(offset, "offset")

    def frames(at: np.ndarray) -> np.ndarray:
        partials = surface.partials(parameters.derivatives(at, 0)[:, 0], 1)
        return np.array([surface_axes(first, second) for _, first, second in partials]) @ offset

    breakpoints = parameters.breakpoints
    off = np.inf
    for count in _KEYFRAMES_PER_SEGMENT:
        grid = np.linspace(breakpoints[:-1], breakpoints[1:], 2 * count + 1)
        theta, between = np.unique(grid[::2]), np.unique(grid[1::2])
        quaternions = matrix_to_quaternion(frames(theta))
        curve = interpolate_orientation(
            quaternions, theta, smoothness=smoothness, closed=parameters.closed
        )
        made = quaternion_to_matrix(curve.derivatives(between, 0)[:, 0])
        # the angle is the length of the difference of rotation matrices over sqrt(2)
        off = np.linalg.norm(made - frames(between), axis=(1, 2)).max() / np.sqrt(2.0)
        if off <= _FAITHFUL:
            return curve
    raise InputError(
        f"orientation: {len(theta)} keyframes of the surface's frame leave {off:.3g} rad;"
        f" at most {_FAITHFUL:g} rad is allowed: a curve with fewer sharp bends is required"
    )
