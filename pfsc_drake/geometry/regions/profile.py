"""Regions bounded by profiles that go on for ever: extruded, or turned about an axis."""

import math
from bisect import bisect_right
from typing import NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.paths.projection import Projector
from pfsc_drake.geometry.regions.pieces import NearestFoot, Pieces
from pfsc_drake.geometry.regions.placement import axes_along, checked_point
from pfsc_drake.geometry.regions.region import Distance, Region

# Of the tangent on a piece, rad, and most pieces of a cell.
_TURNING = 0.12
_MOST_PIECES = 64
_SAMPLES = 17


class PlaneCurve:
    """Signed distance from a curve in the plane, positive to the right of its way.

    Both ends of an open curve go on straight along their tangents, so that it divides the plane.

    Args:
        curve: Of dimension 2, m.
        ends_at_axis: Whether what goes on ends where the first coordinate is zero.

    Attributes:
        counter_clockwise: Whether a closed curve runs that way round.

    Raises:
        InputError: The curve is not of class C^2 or not regular, or meets what goes on.
    """

    def __init__(self, curve: PiecewisePolynomialCurve, *, ends_at_axis: bool = False) -> None:
        if curve.smoothness < 2:
            raise InputError(
                f"profile: class C^{curve.smoothness:g}; C^2 or smoother is required of a region"
            )
        flat = np.zeros((*curve.coefficients.shape[:2], 3))
        flat[..., :2] = curve.coefficients
        lifted = PiecewisePolynomialCurve(
            curve.breakpoints,
            flat,
            closed=curve.closed,
            known_smoothness=int(min(curve.smoothness, curve.degree)),
        )
        self._curve = lifted
        edges = _edges(lifted)
        self._middles = (0.5 * (edges[1:] + edges[:-1])).tolist()
        self._inner = edges[1:-1].tolist()
        self._sample = lifted.flat_sampler(1)
        self._projector = Projector(lifted)
        self._nearest = NearestFoot(_pieces(lifted, edges), self._project)
        corners = lifted.derivatives(edges, 0)[:, 0, :2]
        x, y = corners.T
        self.counter_clockwise = bool(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) > 0.0)
        self._rays = [] if curve.closed else _rays(lifted, ends_at_axis)
        _refuse_crossings(corners, self._rays)

    def __call__(self, x: float, y: float) -> tuple[float, float, float]:
        """Distance of a point, m, and its gradient."""
        foot = self._nearest(x, y, 0.0)
        h, n_x, n_y = foot.signed
        for ray in self._rays:
            a, b = x - ray.x, y - ray.y
            along = a * ray.t_x + b * ray.t_y
            if along <= 0.0:
                continue
            height = a * ray.n_x + b * ray.n_y
            over = max(along - ray.length, 0.0)
            away = math.hypot(height, over)
            if away < abs(h):
                if over:
                    side = math.copysign(1.0, height)
                    scale = side / away
                    h = side * away
                    n_x = scale * (height * ray.n_x + over * ray.t_x)
                    n_y = scale * (height * ray.n_y + over * ray.t_y)
                else:
                    h, n_x, n_y = height, ray.n_x, ray.n_y
        return h, n_x, n_y

    def _project(self, x: float, y: float, z: float, row: int, column: int) -> "_CurveFoot":
        foot = self._projector.project((x, y, z), self._middles[row])
        a, b, _, u, v, _ = self._sample(foot.theta).tolist()
        a, b = x - a, y - b
        scale = 1.0 / math.sqrt(u * u + v * v)
        n_x, n_y = scale * v, -scale * u
        along = a * n_x + b * n_y
        away = math.sqrt(a * a + b * b)
        signed = along, n_x, n_y
        if away and (foot.at_end or not foot.converged):
            side = math.copysign(1.0, along)
            signed = side * away, side * a / away, side * b / away
        piece = None
        if not foot.at_end:
            piece = bisect_right(self._inner, float(self._curve.wrap(foot.theta))), 0
        return _CurveFoot(away, piece, bool(along < 0.0), signed)


class ProfileRegion(Region):
    """What lies on one side of a profile that is swept through space."""

    @property
    def signed_distance(self) -> NoReturn:
        """See the base class."""
        raise InputError(
            "profile: its nearest place is searched for, in as many steps as that takes; no formula"
            " has it"
        )


class ExtrudedRegion(ProfileRegion):
    """What lies on one side of a profile that is moved along a line without end.

    Both ends of an open profile go on straight.

    Args:
        profile: Curve in R^3 of class C^2, m.
        direction: Of the line, of any length, [3].
        inside: Whether what a closed profile encloses is admissible; of an open one the side that
            the normal (4.3) of `extruded_surface` points away from.

    Raises:
        InputError: No such profile or direction, or an open profile whose ends, going on, meet it.
    """

    def __init__(
        self, profile: PiecewisePolynomialCurve, direction: ArrayLike, *, inside: bool
    ) -> None:
        axes = axes_along(direction)[:2]
        self._axes = tuple(axes.ravel().tolist())
        curve = PiecewisePolynomialCurve(
            profile.breakpoints,
            profile.coefficients @ axes.T,
            closed=profile.closed,
            known_smoothness=int(min(profile.smoothness, profile.degree)),
        )
        self._curve = PlaneCurve(curve)
        self._sign = _right_sign(self._curve, profile.closed, inside)

    def distance(self, x: float, y: float, z: float) -> Distance:
        """See the base class."""
        ax, ay, az, bx, by, bz = self._axes
        h, a, b = self._curve(ax * x + ay * y + az * z, bx * x + by * y + bz * z)
        sign = self._sign
        a, b = sign * a, sign * b
        return sign * h, a * ax + b * bx, a * ay + b * by, a * az + b * bz


class RevolvedRegion(ProfileRegion):
    """What lies on one side of a profile that is turned about an axis.

    Both ends of an open profile go on straight, to the axis or without end.

    Args:
        profile: (rho, h), a curve in the plane of class C^2, m, that does not meet the axis.
        origin: On the axis, where h is zero, [3], m.
        axis: Of growing h, of any length, [3].
        inside: Whether what a closed profile encloses is admissible; of an open one the side that
            the normal (4.3) of `surface_of_revolution` points away from: that of the axis, where h
            grows along the profile.

    Raises:
        InputError: No such profile, point or direction, or an open profile whose ends, going on,
            meet it.
    """

    def __init__(
        self,
        profile: PiecewisePolynomialCurve,
        origin: ArrayLike,
        axis: ArrayLike,
        *,
        inside: bool,
    ) -> None:
        self._origin = checked_point("origin", origin)
        self._axes = tuple(axes_along(axis).ravel().tolist())
        self._curve = PlaneCurve(profile, ends_at_axis=True)
        self._sign = _right_sign(self._curve, profile.closed, inside)

    def distance(self, x: float, y: float, z: float) -> Distance:
        """See the base class."""
        a, b, c = self._origin
        x, y, z = x - a, y - b, z - c
        ax, ay, az, bx, by, bz, cx, cy, cz = self._axes
        a, b, c = ax * x + ay * y + az * z, bx * x + by * y + bz * z, cx * x + cy * y + cz * z
        rho = math.sqrt(a * a + b * b)
        h, radial, axial = self._curve(rho, c)
        radial, axial = self._sign * radial, self._sign * axial
        a, b = (radial * a / rho, radial * b / rho) if rho else (radial, 0.0)
        return (
            self._sign * h,
            a * ax + b * bx + axial * cx,
            a * ay + b * by + axial * cy,
            a * az + b * bz + axial * cz,
        )


class _CurveFoot(NamedTuple):
    distance: float
    piece: tuple[int, int] | None
    below: bool
    signed: tuple[float, float, float]


class _Ray(NamedTuple):
    """Where an end goes on: from a point along t, with the right of the curve's way, n."""

    x: float
    y: float
    t_x: float
    t_y: float
    n_x: float
    n_y: float
    length: float


def _right_sign(curve: PlaneCurve, closed: bool, inside: bool) -> float:
    """Sign of what is to the right of a curve."""
    right_is_outside = curve.counter_clockwise or not closed
    return 1.0 if right_is_outside != inside else -1.0


def _edges(curve: PiecewisePolynomialCurve) -> np.ndarray:
    """Parameters between pieces on which the tangent turns little, [pieces + 1]."""
    parts = np.linspace(0.0, 1.0, _SAMPLES)
    begin, length = curve.breakpoints[:-1, None], np.diff(curve.breakpoints)[:, None]
    # the ends of a cell are left to the cell beside
    tangent = curve.derivatives(begin + length * parts[None, :-1], 1)[..., 1, :2]
    angle = np.unwrap(np.arctan2(tangent[..., 1], tangent[..., 0]), axis=1)
    turning = np.abs(np.diff(angle, axis=1)).sum(axis=1) * _SAMPLES / (_SAMPLES - 2)
    counts = np.clip(np.ceil(turning / _TURNING), 1, _MOST_PIECES).astype(int)
    inner = [
        b + n * np.arange(count) / count
        for b, n, count in zip(begin[:, 0], length[:, 0], counts, strict=True)
    ]
    return np.append(np.concatenate(inner), curve.breakpoints[-1])


def _pieces(curve: PiecewisePolynomialCurve, edges: np.ndarray) -> Pieces:
    """Pieces of a plane curve in R^3."""
    half = 0.5 * np.diff(edges)
    parts = np.linspace(-1.0, 1.0, 5)
    theta = 0.5 * (edges[1:] + edges[:-1])[:, None] + half[:, None] * parts
    _, first, second, third = np.moveaxis(curve.derivatives(theta, 3), -2, 0)
    speed = np.linalg.norm(first, axis=-1)
    if not np.all(speed > 1e-9 * speed.max()):
        raise InputError("profile: its tangent vanishes; a regular curve is required of a region")
    # no place is further from a sample than a quarter of the half
    bend = np.linalg.norm(second, axis=-1).max(axis=1)
    bend = bend + 0.25 * half * np.linalg.norm(third, axis=-1).max(axis=1)
    left = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    left = left / speed**3
    middle = first[:, 2] / speed[:, 2, None]
    return Pieces(
        curve.derivatives(theta[:, 2], 0)[:, None, 0],
        np.stack([middle[:, 1], -middle[:, 0], middle[:, 2]], axis=-1)[:, None],
        (half * speed[:, 2])[:, None],
        (0.5 * bend * half**2)[:, None],
        np.stack([(-left).max(axis=1), left.max(axis=1)])[:, :, None],
        (curve.closed, False),
    )


def _rays(curve: PiecewisePolynomialCurve, ends_at_axis: bool) -> list[_Ray]:
    """What goes on at both ends of an open curve."""
    rays = []
    for theta, onwards in zip(curve.domain, (-1.0, 1.0), strict=True):
        (x, y, _), tangent = curve.derivatives(theta, 1).tolist()
        u, v = (np.array(tangent[:2]) / math.hypot(*tangent[:2])).tolist()
        towards_axis = ends_at_axis and onwards * u < 0.0
        length = x / -(onwards * u) if towards_axis else math.inf
        rays.append(_Ray(x, y, onwards * u, onwards * v, v, -u, length))
    return rays


def _refuse_crossings(corners: np.ndarray, rays: list[_Ray]) -> None:
    """Ends that go on must not meet the curve or each other."""
    far = 10.0 * float(np.ptp(corners, axis=0).max())
    tails = []
    for k, ray in enumerate(rays):
        tail = [min(ray.length, far) * np.array([ray.t_x, ray.t_y]) + (ray.x, ray.y)]
        tails.append((np.array([ray.x, ray.y]), tail[0]))
        own = corners[2:] if k == 0 else corners[:-2]
        if _cross(*tails[k], own[:-1], own[1:]).any():
            raise InputError(
                f"profile: its {'first' if k == 0 else 'last'} end, going on straight, meets it;"
                " an open profile must divide what is on either side, or be closed"
            )
    if len(tails) == 2 and _cross(*tails[0], tails[1][0][None], tails[1][1][None]).any():
        raise InputError(
            "profile: its ends, going on straight, meet each other; an open profile must divide"
            " what is on either side, or be closed"
        )


def _cross(a: np.ndarray, b: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Whether the line from a to b crosses each of others, [n]."""

    def side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
        u, v = q - p, r - p
        return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])

    across = side(a, b, starts) * side(a, b, ends) < 0.0
    return np.asarray(across & (side(starts, ends, a) * side(starts, ends, b) < 0.0))
