"""Signed distance from a plane curve with straight extensions at its ends."""

import math
from typing import NamedTuple

import casadi as ca
import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.closest_point import ClosestPointFinder
from pfsc_drake.geometry.curves.polynomial import PieceTable, PiecewisePolynomialCurve
from pfsc_drake.geometry.regions.pieces import ON_NO_PIECE, Pieces, closest_boundary_point
from pfsc_drake.geometry.regions.region import direction

# Of the tangent on a piece, rad, and most pieces of a cell.
_TURNING = 0.12
_MOST_PIECES = 64
_SAMPLES = 17
# Of Newton's method, relative to the length of the domain.
_LONGEST_STEP = 1.0 / 32.0


class PlaneCurve:
    """Signed distance from a plane curve, positive on its right.

    Both ends of an open curve are extended along their tangents, so that it divides the plane.

    Args:
        curve: Curve of dimension 2, m.
        ends_at_axis: Whether the extensions end where the first coordinate is zero.

    Attributes:
        counter_clockwise: Whether a closed curve runs counter-clockwise.
        signed_distance: Function ``point -> (h, n)``, both shape (2,) but h [m].

    Raises:
        InputError: The curve is not of class C^2 or not regular, or meets its extensions.
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
        edges = _edges(lifted)
        nearest = closest_boundary_point(_pieces(lifted, edges), _closest_on_piece(lifted, edges))
        corners = lifted.derivatives(edges, 0)[:, 0, :2]
        x, y = corners.T
        self.counter_clockwise = bool(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) > 0.0)
        rays = [] if curve.closed else _rays(lifted, ends_at_axis)
        _refuse_crossings(corners, rays)

        point = ca.MX.sym("place", 2)
        closest_point = nearest(ca.vertcat(point, 0.0))
        h, n = closest_point[3], closest_point[4:]
        for ray in rays:
            h, n = ray.nearer(point, h, n)
        self.signed_distance = ca.Function("plane_curve", [point], [h, n], ["place"], ["h", "n"])


class _Ray(NamedTuple):
    """Straight extension of an end: from a begin along t, with n to the right of the curve."""

    begin: ca.DM
    t: ca.DM
    n: ca.DM
    length: float

    def nearer(self, point: ca.MX, h: ca.MX, n: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Return signed distance and normal, of this ray where it is nearer than h."""
        offset = point - self.begin
        along, height = ca.dot(offset, self.t), ca.dot(offset, self.n)
        over = ca.fmax(along - self.length, 0.0)
        away, outwards = direction(ca.vertcat(height, over), (1.0, 0.0))
        side = ca.copysign(1.0, height)
        is_nearer = ca.logic_and(along > 0.0, away < ca.fabs(h))
        own = side * (outwards[0] * self.n + outwards[1] * self.t)
        return (
            ca.if_else(is_nearer, side * away, h),
            ca.if_else(is_nearer, ca.if_else(over > 0.0, own, self.n), n),
        )


def _closest_on_piece(curve: PiecewisePolynomialCurve, edges: np.ndarray) -> ca.Function:
    """Return ``(point, number) -> minimum``, see :func:`closest_boundary_point`, shape (6,).

    Its further quantities are h and n.
    """
    (begin, end), breakpoints = curve.domain, ca.MX(ca.DM(edges))
    middles = ca.MX(ca.DM(0.5 * (edges[1:] + edges[:-1])))
    table = PieceTable(curve.breakpoints, _with_derivatives(curve.coefficients))

    def wrap(theta: ca.MX) -> ca.MX:
        return theta - curve.period * ca.floor((theta - begin) / curve.period)

    def terms(theta: ca.MX) -> ca.MX:
        return ca.reshape(table(wrap(theta) if curve.closed else theta), 3, 3)

    point, number = ca.MX.sym("point", 3), ca.MX.sym("number")
    finder = ClosestPointFinder(terms, [(begin, end)], [curve.closed], _LONGEST_STEP)
    closest_point = finder.find(point, middles[number])
    position, tangent, _ = ca.horzsplit(terms(closest_point.theta))
    offset, scale = (point - position)[:2], ca.norm_2(tangent)
    normal = ca.vertcat(tangent[1], -tangent[0]) / scale
    along = ca.dot(offset, normal)
    away, outwards = direction(offset, (0.0, 0.0))
    side = ca.copysign(1.0, along)
    is_normal = ca.logic_or(
        away == 0.0, ca.logic_and(closest_point.converged, ca.logic_not(closest_point.beyond_end))
    )
    piece = ca.low(breakpoints, wrap(closest_point.theta))
    found = [
        away,
        ca.if_else(closest_point.beyond_end, ON_NO_PIECE, piece),
        along < 0.0,
        ca.if_else(is_normal, along, side * away),
        ca.if_else(is_normal, normal, side * outwards),
    ]
    return ca.Function("foot_of_piece", [point, number], [ca.vertcat(*found)])


def _with_derivatives(coefficients: np.ndarray) -> np.ndarray:
    """Return coefficients of a curve and of its first two derivatives, [pieces, 9, powers]."""
    powers, rows = coefficients.shape[1], []
    for order in range(3):
        row = np.polynomial.polynomial.polyder(coefficients, order, axis=1)
        rows.append(np.pad(row, ((0, 0), (0, powers - row.shape[1]), (0, 0))))
    return np.concatenate(rows, axis=2).transpose(0, 2, 1)


def _edges(curve: PiecewisePolynomialCurve) -> np.ndarray:
    """Return parameters between pieces on which the tangent turns little, [pieces + 1]."""
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
    """Return pieces of a plane curve in R^3."""
    half = 0.5 * np.diff(edges)
    parts = np.linspace(-1.0, 1.0, 5)
    theta = 0.5 * (edges[1:] + edges[:-1])[:, None] + half[:, None] * parts
    _, first, second, third = np.moveaxis(curve.derivatives(theta, 3), -2, 0)
    speed = np.linalg.norm(first, axis=-1)
    if not np.all(speed > 1e-9 * speed.max()):
        raise InputError("profile: its tangent vanishes; a regular curve is required of a region")
    # no parameter is further from a sample than a quarter of the half
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
    """Return the straight extensions at both ends of an open curve."""
    rays = []
    for theta, onwards in zip(curve.domain, (-1.0, 1.0), strict=True):
        (x, y, _), tangent = curve.derivatives(theta, 1).tolist()
        u, v = (np.array(tangent[:2]) / math.hypot(*tangent[:2])).tolist()
        towards_axis = ends_at_axis and onwards * u < 0.0
        length = x / -(onwards * u) if towards_axis else math.inf
        t, n = ca.DM([onwards * u, onwards * v]), ca.DM([v, -u])
        rays.append(_Ray(ca.DM([x, y]), t, n, length))
    return rays


def _refuse_crossings(corners: np.ndarray, rays: list[_Ray]) -> None:
    """Refuse extensions that meet the curve or each other."""
    far = 10.0 * float(np.ptp(corners, axis=0).max())
    tails = []
    for k, ray in enumerate(rays):
        start = ray.begin.full().ravel()
        tails.append((start, start + min(ray.length, far) * ray.t.full().ravel()))
        own = corners[2:] if k == 0 else corners[:-2]
        if _cross(*tails[k], own[:-1], own[1:]).any():
            raise InputError(
                f"profile: its {'first' if k == 0 else 'last'} end, extended straight, meets it;"
                " an open profile must divide the plane into two sides, or be closed"
            )
    if len(tails) == 2 and _cross(*tails[0], tails[1][0][None], tails[1][1][None]).any():
        raise InputError(
            "profile: its ends, extended straight, meet each other; an open profile must divide"
            " the plane into two sides, or be closed"
        )


def _cross(a: np.ndarray, b: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return whether the line from a to b crosses each of others, [n]."""

    def side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
        u, v = q - p, r - p
        return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])

    across = side(a, b, starts) * side(a, b, ends) < 0.0
    return np.asarray(across & (side(starts, ends, a) * side(starts, ends, b) < 0.0))
