"""Edges: the curves in which two surfaces intersect."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.fourier_curve import FourierCurve
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.curves.spline import interpolate
from pfsc_drake.geometry.intersections.meeting import (
    SAME,
    Meeting,
    numbers,
    require_crossing,
    starts,
)
from pfsc_drake.geometry.intersections.trace import Trace, Tracer
from pfsc_drake.geometry.surfaces.parametric_surface import Surface

# Of the size of a curve: largest distance of its points from it.
_EXACT = 1e-10


def line_or_ellipse(points: np.ndarray, is_closed: bool) -> Curve | None:
    """Return the straight line, circle or ellipse that points are on, or None if there is none.

    It begins at the first point and runs in the order of the others; points are off it by 1e-10 of
    its size at most.

    Args:
        points: Exact points along a curve, five or more if it is closed, [n, 3], m.
        is_closed: Whether the last is a neighbour of the first; only such ellipses are known.
    """
    middle = points.mean(axis=0)
    _, widths, axes = np.linalg.svd(points - middle, full_matrices=False)
    allowed = _EXACT * float(np.linalg.norm(np.ptp(points, axis=0)))
    if not is_closed:
        if np.linalg.norm((points - middle) @ axes[1:].T, axis=1).max() > allowed:
            return None
        return PiecewisePolynomialCurve.line(points[0], points[-1])
    x, y, off = ((points - middle) @ axes.T).T
    if np.abs(off).max() > allowed or widths[1] <= allowed:
        return None
    return _ellipse(np.column_stack([x, y]), middle, axes[:2], allowed)


def _ellipse(
    points: np.ndarray, middle: np.ndarray, axes: np.ndarray, allowed: float
) -> FourierCurve | None:
    """Return the ellipse in a plane through ``middle + points @ axes``, or None."""
    scale = np.abs(points).max()
    x, y = (points / scale).T
    # a x^2 + b x y + c y^2 + d x + e y = 1
    terms = np.column_stack([x * x, x * y, y * y, x, y])
    a, b, c, d, e = np.linalg.lstsq(terms, np.ones(len(x)), rcond=None)[0]
    form = np.array([[a, b / 2.0], [b / 2.0, c]])
    if not np.linalg.det(form) > 0.0:
        return None
    center = -0.5 * np.linalg.solve(form, [d, e])
    level = 1.0 + center @ form @ center
    if not (level > 0.0 and a > 0.0):
        return None
    # points = center + root @ (cos, sin)
    root = np.linalg.inv(np.linalg.cholesky(form / level)).T
    unit = np.linalg.solve(root, (points / scale - center).T).T
    if scale * np.abs(np.linalg.norm(unit, axis=1) - 1.0).max() > allowed:
        return None
    begin = math.atan2(unit[0, 1], unit[0, 0])
    sense = 1.0 if np.cross([*unit[0], 0.0], [*unit[1], 0.0])[2] > 0.0 else -1.0
    cosine, sine = math.cos(begin), math.sin(begin)
    turned = root @ np.array([[cosine, -sense * sine], [sine, sense * cosine]])
    return FourierCurve(
        middle + scale * center @ axes, [scale * turned[:, 0] @ axes], [scale * turned[:, 1] @ axes]
    )


TOLERANCE = 1e-6
_LEAST_TOLERANCE = 1e-9
# Points within each piece of a spline at which its distance from the edge is evaluated.
_CHECKS = np.linspace(0.05, 0.95, 8)
# Of the tolerance: largest distance there, so that the tolerance holds in between, too.
_CHECKED_SHARE = 0.35
_MOST_REFINEMENTS, _MOST_NODES = 16, 20_000
# Of the size: length along an edge within which the closest point to a point is searched.
_AROUND = 0.05


class Edge(NamedTuple):
    """Curve in which two surfaces intersect.

    Attributes:
        curve: The curve along ``n_1 x n_2``: a line, a circle, an ellipse, or else a spline.
        theta: Parameters of both surfaces at nodes along it, not wrapped, [n, 4].
        deviation: Largest distance of the curve from the edge, m.
    """

    curve: Curve
    theta: np.ndarray
    deviation: float


def find_edges(
    first: Surface, second: Surface, *, smoothness: int, tolerance: float = TOLERANCE
) -> list[Edge]:
    """Return all edges of two surfaces, the one of most nodes first.

    Edges smaller than the samples of :func:`sample_grid` may be overlooked.

    Args:
        first: Surface of class C^2; all edges are cut where it or the other one ends.
        second: The other.
        smoothness: k of the class C^k of splines, 2..6.
        tolerance: Largest deviation of a spline, m.

    Raises:
        InputError: They do not intersect, coincide, or touch somewhere; says where.
    """
    meeting, tolerance = Meeting([first, second]), _check_tolerance(tolerance)
    theta = _points_on_edges(meeting)
    require_crossing(meeting, theta)
    tracer, edges = Tracer(meeting), []
    while len(theta):
        trace = tracer.trace(theta[0])
        edges.append(_fit(meeting, trace, smoothness, tolerance))
        theta = theta[1:][~_on_trace(meeting, trace, theta[1:])]
    return sorted(edges, key=lambda edge: -len(edge.theta))


def find_edge(
    first: Surface,
    second: Surface,
    *,
    near: ArrayLike,
    smoothness: int,
    tolerance: float = TOLERANCE,
) -> Edge:
    """Return the edge of two surfaces nearest to a point; a closed one begins there.

    Args:
        first: As for :func:`find_edges`.
        second: Likewise.
        near: The point, [3], m.
        smoothness: As for :func:`find_edges`.
        tolerance: Likewise.

    Raises:
        InputError: As for :func:`find_edges`; only this edge counts.
    """
    point, meeting, tolerance = (
        np.asarray(near, float),
        Meeting([first, second]),
        _check_tolerance(tolerance),
    )
    if point.shape != (3,) or not np.all(np.isfinite(point)):
        raise InputError(f"near: {point.tolist()}; 3 finite numbers, in m, are required")
    theta = _points_on_edges(meeting)
    far = np.linalg.norm(meeting.partials(theta, 0)[0, :, 0] - point, axis=1)
    nearest = theta[np.argmin(far)][None]
    require_crossing(meeting, nearest)
    nearest = _nearer(meeting, nearest, point)
    return _fit(meeting, Tracer(meeting).trace(nearest[0]), smoothness, tolerance)


def _nearer(meeting: Meeting, theta: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return the parameters [1, 4] of an edge's closest point to a point, near a first guess."""
    sigma = meeting.partials(theta, 0)[0, :, 0]
    tangent = np.cross(*meeting.normals(theta))
    tangent /= np.linalg.norm(tangent)

    def at(offset: float) -> np.ndarray:
        there, good = meeting.solve(theta, (sigma + offset * tangent, tangent))
        return there if good[0] else theta

    def distance(offset: float) -> float:
        return float(np.linalg.norm(meeting.partials(at(offset), 0)[0, 0, 0] - point))

    around = _AROUND * meeting.size
    options = {"xatol": SAME * meeting.size}
    found = minimize_scalar(distance, bounds=(-around, around), method="bounded", options=options)
    return at(float(found.x))


def _check_tolerance(tolerance: float) -> float:
    if not _LEAST_TOLERANCE <= tolerance < np.inf:
        raise InputError(f"tolerance: {tolerance} m; {_LEAST_TOLERANCE:g} m or more is required")
    return tolerance


def _points_on_edges(meeting: Meeting) -> np.ndarray:
    """Return the parameters of points on all edges, [n, 4]."""
    theta, good = meeting.solve(starts(meeting.surfaces))
    if not good.any():
        raise InputError(
            "surfaces: do not meet within their bounds, though they come as near as "
            f"{meeting.gaps(theta).min():.3g} m; larger or other ones are required"
        )
    return theta[good]


def _on_trace(meeting: Meeting, trace: Trace, theta: np.ndarray) -> np.ndarray:
    """Return whether points on edges, [n, 4], are on a traced one, [n]."""
    if not len(theta):
        return np.zeros(0, dtype=bool)
    nodes = meeting.partials(trace.theta, 0)[0, :, 0]
    points = meeting.partials(theta, 0)[0, :, 0]
    far = np.linalg.norm(nodes - points[:, None], axis=2)
    nearest, far = far.argmin(axis=1), far.min(axis=1)
    steps = np.linalg.norm(np.diff(nodes, axis=0, append=nodes[:1]), axis=1)
    if not trace.is_closed:
        steps[-1] = 0.0
    local = np.maximum(steps, np.roll(steps, 1))[nearest]
    tangents = np.cross(*meeting.normals(theta))
    projected, good = meeting.solve(trace.theta[nearest], (points, tangents))
    off = np.linalg.norm(meeting.partials(projected, 0)[0, :, 0] - points, axis=1)
    same = 10.0 * SAME * meeting.size
    return np.asarray((good & (off < same) & (far < local)) | (far < same))


def _fit(meeting: Meeting, trace: Trace, smoothness: int, tolerance: float) -> Edge:
    """Return a curve through the nodes of an edge, refined until it is near enough."""
    theta = trace.theta
    for _ in range(_MOST_REFINEMENTS):
        points = meeting.partials(theta, 0)[0, :, 0]
        enough = len(points) >= max(8, smoothness + 2)
        if enough:
            exact = line_or_ellipse(points, trace.is_closed)
            if exact is not None:
                return Edge(exact, theta, 0.0)
        begin, end = _neighbours(meeting, theta, trace.is_closed)
        far = np.ones(len(begin), dtype=bool)
        if enough:
            parameters = _arc_lengths(meeting, theta, trace.is_closed)
            curve = interpolate(
                points, smoothness=smoothness, closed=trace.is_closed, parameters=parameters
            )
            off = _deviations(meeting, curve, parameters, begin, end)
            if off.max() <= _CHECKED_SHARE * tolerance:
                return Edge(curve, theta, float(off.max()))
            far = off > _CHECKED_SHARE * tolerance
        theta = _refine(meeting, theta, begin, end, far)
        if len(theta) > _MOST_NODES:
            break
    raise InputError(
        f"tolerance: {tolerance:g} m; the edge near {numbers(points[0])} needs more than "
        f"{len(theta)} nodes for it: a larger one, or smoother surfaces, are required"
    )


def _neighbours(
    meeting: Meeting, theta: np.ndarray, is_closed: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return parameters at both ends of all pieces between nodes, [pieces, 4] each."""
    if not is_closed:
        return theta[:-1], theta[1:]
    # the first node again, unwrapped towards the last one
    turns = np.round((theta[-1] - theta[0]) / meeting.lengths) * meeting.closed
    return theta, np.vstack([theta[1:], theta[:1] + turns * meeting.lengths])


def _arc_lengths(meeting: Meeting, theta: np.ndarray, is_closed: bool) -> np.ndarray:
    """Return arc lengths of an edge's nodes, by circular arcs; of a closed edge its length, too."""
    begin, end = _neighbours(meeting, theta, is_closed)
    chords = np.linalg.norm(
        meeting.partials(end, 0)[0, :, 0] - meeting.partials(begin, 0)[0, :, 0], axis=1
    )
    tangents = [np.cross(*meeting.normals(ends)) for ends in (begin, end)]
    tangents = [each / np.linalg.norm(each, axis=1, keepdims=True) for each in tangents]
    half = np.arcsin(np.minimum(1.0, 0.5 * np.linalg.norm(tangents[1] - tangents[0], axis=1)))
    return np.concatenate([[0.0], np.cumsum(chords / np.sinc(half / np.pi))])


def _deviations(
    meeting: Meeting, curve: Curve, parameters: np.ndarray, begin: np.ndarray, end: np.ndarray
) -> np.ndarray:
    """Return the largest distance of each piece of a curve from the edge, [pieces], m."""
    off = np.zeros(len(begin))
    for share in _CHECKS:
        at = curve.derivatives(parameters[:-1] + share * np.diff(parameters), 1)
        tangents = at[:, 1] / np.linalg.norm(at[:, 1], axis=1, keepdims=True)
        theta, good = meeting.solve((1.0 - share) * begin + share * end, (at[:, 0], tangents))
        gap = np.linalg.norm(meeting.partials(theta, 0)[0, :, 0] - at[:, 0], axis=1)
        off = np.maximum(off, np.where(good, gap, np.inf))
    return off


def _refine(
    meeting: Meeting, theta: np.ndarray, begin: np.ndarray, end: np.ndarray, far: np.ndarray
) -> np.ndarray:
    """Return the nodes with one more in the middle of each piece that is too far off."""
    ends = [meeting.partials(part[far], 0)[0, :, 0] for part in (begin, end)]
    chords = ends[1] - ends[0]
    lengths = np.linalg.norm(chords, axis=1)
    normals = chords / lengths[:, None]
    middle = 0.5 * (begin[far] + end[far])
    between, good = meeting.solve(middle, (0.5 * (ends[0] + ends[1]), normals))
    if not good.all():
        lost = 0.5 * (ends[0] + ends[1])[~good][0]
        raise InputError(
            f"surfaces: their edge leaves one of them for less than {lengths[~good][0]:.2g} m"
            f" near {numbers(lost)}; larger or smaller bounds are required"
        )
    return np.insert(theta, np.flatnonzero(far) + 1, between, axis=0)
