"""Paths on a surface, whose frame contains the surface's normal."""

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from pfsc_drake import jets
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve, check_order
from pfsc_drake.geometry.curves.orientation_curve import OrientationCurve, interpolate_orientation
from pfsc_drake.geometry.curves.spline import accumulate, close_polygon, interpolate_at
from pfsc_drake.geometry.paths.geometric_path import Path
from pfsc_drake.geometry.rotation import (
    check_rotation_matrix,
    matrix_to_quaternion,
    quaternion_to_matrix,
)
from pfsc_drake.geometry.surfaces.curvature import surface_axes
from pfsc_drake.geometry.surfaces.parametric_surface import Surface, partial_index, partial_orders
from pfsc_drake.geometry.surfaces.surface_projection import GlobalProjector
from pfsc_drake.jets import Jet

# Between two breakpoints of a curve, to find where it leaves a cell of the surface.
_SAMPLES = 129


class CurveOnSurface(Curve):
    """The curve ``sigma_t(c(theta))`` of a surface and a curve c of its parameters.

    Args:
        surface: The surface sigma_t.
        parameters: Curve c in the surface's parameters, of dimension 2, unwrapped in closed
            directions of the surface.

    Attributes:
        surface: The surface.

    Raises:
        InputError: The curve is not two-dimensional, or leaves the surface.
    """

    def __init__(self, surface: Surface, parameters: Curve) -> None:
        if parameters.dimension != 2:
            raise InputError(
                f"path on a surface: curve of dimension {parameters.dimension}; 2 is required"
            )
        breakpoints = _with_seams(surface, parameters)
        smoothness = min(surface.smoothness, parameters.smoothness)
        super().__init__(3, breakpoints, closed=parameters.closed, smoothness=smoothness)
        self.surface, self._parameters = surface, parameters
        surface.to_domain(parameters.derivatives(np.linspace(*parameters.domain, 257), 0)[:, 0])

    def derivatives(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Return derivatives 0..order with respect to theta, for set-up and figures."""
        jet = self._compose(theta, check_order(order), [(0, 0)])[0]
        return np.stack(jet.derivatives(), axis=-2)

    def normals(self, theta: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return the surface's normal e_perp (4.3), and e_cross = e_par x e_perp, each [..., 3]."""
        e_par, normal = self._axes(theta, 0)
        return normal.coefficients[0], np.cross(e_par.coefficients[0], normal.coefficients[0])

    def turning(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Return derivatives 1..order of psi, [..., order].

        ``psi' = (e_par x e_perp) . e_perp'``, speed times geodesic torsion.
        """
        e_par, normal = self._axes(theta, order)
        rate = _dot(jets.cross(e_par, normal), normal.differentiate())
        return np.stack(rate.derivatives(), axis=-2)[..., 0]

    def _axes(self, theta: ArrayLike, order: int) -> tuple[Jet, Jet]:
        """Return the tangent and normal as jets by theta, coefficients [..., 3]."""
        position = self._compose(theta, order + 1, [(0, 0)])[0].differentiate()
        first, second = self._compose(theta, order, [(1, 0), (0, 1)])
        return _unit(position), _unit(jets.cross(first, second))

    def _compose(self, theta: ArrayLike, order: int, which: list[tuple[int, int]]) -> list[Jet]:
        """Return partial derivatives of the surface along the curve as jets by theta, [..., 3]."""
        c = self._parameters.derivatives(theta, order)
        pair = [
            Jet.from_derivatives([c[..., k, i, None] for k in range(order + 1)]) for i in (0, 1)
        ]
        highest = order + max(i + j for i, j in which)
        partials = self.surface.partials(c[..., 0, :], highest)
        return [
            jets.compose_pair(
                [partials[..., partial_index(i + a, j + b), :] for i, j in partial_orders(order)],
                *pair,
            )
            for a, b in which
        ]


class SurfaceNormalFrame:
    """The frame along a curve on a surface whose e_perp is the surface's normal.

    Args:
        curve: The curve.

    Attributes:
        turns: True.
        holonomy: Zero: where the curve closes, so does the frame.
        breakpoints: Ends of the pieces on which it is smooth, [n].
    """

    turns = True
    holonomy = 0.0

    def __init__(self, curve: CurveOnSurface) -> None:
        self.normals, self.turning = curve.normals, curve.turning
        self.breakpoints = curve.breakpoints


def path_on_surface(
    surface: Surface,
    parameters: Curve,
    orientation: OrientationCurve | None = None,
    notes: tuple[str, ...] = (),
) -> Path:
    """Return a path on a surface whose transversal coordinates are normal and sideways.

    xi_1 is the distance along the surface's normal, xi_2 the side step along e_par x e_perp.

    Args:
        surface: Surface of class C^2 or better.
        parameters: Curve in its parameters, of dimension 2.
        orientation: Quaternions over the same parameter, or None.
        notes: Sentences on ignored parts of a file.

    Raises:
        InputError: The curve leaves the surface, is no curve in its parameters, or not regular.
    """
    curve = CurveOnSurface(surface, parameters)
    return Path(curve, orientation, frame=SurfaceNormalFrame(curve), notes=notes)


def _with_seams(surface: Surface, parameters: Curve) -> np.ndarray:
    """Return a curve's breakpoints and the parameters where it enters another cell."""
    grid = np.unique(np.linspace(parameters.breakpoints[:-1], parameters.breakpoints[1:], _SAMPLES))
    values = parameters.derivatives(grid, 0)[:, 0]
    seams = [parameters.breakpoints]
    for k, (breaks, closed) in enumerate(zip(surface.breakpoints, surface.closed, strict=True)):
        if len(breaks) == 2 and (not closed or surface.smoothness == math.inf):
            continue
        own, period = values[:, k], breaks[-1] - breaks[0]
        revolutions = np.arange(
            math.floor((own.min() - breaks[0]) / period),
            math.ceil((own.max() - breaks[0]) / period),
        )
        levels = np.unique(breaks + period * revolutions[:, None]) if closed else breaks[1:-1]
        for level in levels:
            for i in np.flatnonzero((own[:-1] - level) * (own[1:] - level) < 0.0):
                seams.append(_crossing(parameters, k, level, (grid[i], grid[i + 1])))
    return np.unique(np.concatenate(seams))


def _crossing(parameters: Curve, k: int, level: float, between: tuple[float, float]) -> np.ndarray:
    """Return the parameter at which a component of a curve has a value, [1]."""

    def excess(theta: float) -> float:
        return float(parameters.derivatives(theta, 0)[0, k]) - level

    return np.array([brentq(excess, *between, xtol=1e-15)])


def _unit(x: Jet) -> Jet:
    return x / jets.sqrt(_dot(x, x))


def _dot(x: Jet, y: Jet) -> Jet:
    return jets.bilinear(lambda a, b: np.sum(a * b, axis=-1, keepdims=True), x, y)


# rad, between the frame and the spline through it
_FAITHFUL = 1e-6
_KEYFRAMES_PER_SEGMENT = (4, 8, 16, 32, 64)


def project_waypoints(
    surface: Surface, positions: np.ndarray, farthest: float, *, closed: bool
) -> np.ndarray:
    """Return the parameters of the closest points of a surface to waypoints.

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
            sheet; or a closed curve goes around a closed direction of the surface.
    """
    projector = GlobalProjector(surface)
    thetas = np.empty((len(positions), 2))
    for row, position in enumerate(positions):
        try:
            closest_point = projector.project(position)
        except InputError as error:
            raise InputError(f"waypoint {row + 1}: {error}") from None
        if closest_point.distance > farthest:
            beside = ", beside its border" if closest_point.at_border else ""
            raise InputError(
                f"waypoint {row + 1}: {position.tolist()} m is"
                f" {1e3 * closest_point.distance:.3g} mm"
                f" from the surface{beside}; at most {1e3 * farthest:.3g} mm is allowed"
            )
        thetas[row] = closest_point.theta
    for k, ends in enumerate(surface.domain):
        if not surface.closed[k]:
            continue
        thetas[:, k] = np.unwrap(thetas[:, k], period=ends.length)
        if closed and abs(thetas[-1, k] - thetas[0, k]) > 0.5 * ends.length:
            raise InputError(
                f"waypoints go around the surface in theta_{k + 1}, from {thetas[0, k]:.6g} to"
                f" {thetas[-1, k]:.6g}; a closed curve must come back to the same theta: leave it"
                " open, with as many revolutions as are needed"
            )
    return thetas


def curve_through(
    surface: Surface, thetas: ArrayLike, *, smoothness: int, closed: bool = False
) -> Curve:
    """Return a spline through waypoints in a surface's parameters, over their polygon's length.

    Args:
        surface: The surface.
        thetas: Parameters [n, 2] of the waypoints, unwrapped in closed directions.
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
    surface.to_domain(polygon)
    _, chords = close_polygon(surface.partials(polygon, 0)[:, 0], closed=False)
    degree = smoothness + 1 if closed else min(smoothness + 1, len(polygon) - 1)
    return interpolate_at(accumulate(chords, "chord"), polygon, degree, closed=closed)


def normal_orientation(
    surface: Surface, parameters: Curve, offset: np.ndarray, *, smoothness: int
) -> OrientationCurve:
    """Return the orientation along a curve that turns with the surface's frame.

    ``R_d = [t_1, e_perp x t_1, e_perp] offset`` (4.2), (4.3), interpolated through enough keyframes
    to be within 1e-6 rad of it.

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
        interpolated = quaternion_to_matrix(curve.derivatives(between, 0)[:, 0])
        # the angle is the length of the difference of rotation matrices over sqrt(2)
        off = np.linalg.norm(interpolated - frames(between), axis=(1, 2)).max() / np.sqrt(2.0)
        if off <= _FAITHFUL:
            return curve
    raise InputError(
        f"orientation: {len(theta)} keyframes of the surface's frame leave {off:.3g} rad;"
        f" at most {_FAITHFUL:g} rad is allowed: a curve with fewer sharp bends is required"
    )
