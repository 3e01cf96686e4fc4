"""Distances between points, line segments and the areas they sweep, as expressions."""

from typing import Any

import casadi as ca

# m^2, below which a segment is a point; m^4, below which a swept area has no inside
_POINT, _FLAT = 1e-12, 1e-18


def to_point(a: Any, b: Any, p: Any) -> Any:
    """Return the distance of a point from a segment.

    Args:
        a: One end of the segment, shape (k,).
        b: The other one, shape (k,).
        p: The point, shape (k,).
    """
    return ca.norm_2(from_nearest(a, b, p))


def from_nearest(a: Any, b: Any, p: Any) -> Any:
    """Return the vector from the closest point of a segment to a point, shape (k,).

    Args:
        a: One end of the segment, shape (k,).
        b: The other one, shape (k,).
        p: The point, shape (k,).
    """
    along, away = b - a, p - a
    share = _within(ca.dot(away, along) / ca.fmax(ca.dot(along, along), _POINT))
    return away - share * along


def to_segment(a: Any, b: Any, c: Any, d: Any) -> tuple[Any, Any]:
    """Return the distance between two segments, and at which share of the second one it is.

    Args:
        a: One end of the first, shape (k,).
        b: The other end of the first, shape (k,).
        c: One end of the second, shape (k,).
        d: The other end of the second, shape (k,).
    """
    away, share = between_nearest(a, b, c, d)
    return ca.norm_2(away), share


def between_nearest(a: Any, b: Any, c: Any, d: Any) -> tuple[Any, Any]:
    """Return the shortest vector between two segments, and the share of the second one it is at.

    The vector leads from the second one to the first, shape (k,). See Ericson, Real-Time
    Collision Detection (2005), Sec. 5.1.9.

    Args:
        a: One end of the first, shape (k,).
        b: The other end of the first, shape (k,).
        c: One end of the second, shape (k,).
        d: The other end of the second, shape (k,).
    """
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = ca.dot(u, u), ca.dot(v, v), ca.dot(u, v)
    uw, vw = ca.dot(u, w), ca.dot(v, w)
    across = uu * vv - uv * uv
    # of parallel segments any point does
    first = _within((uv * vw - uw * vv) / ca.fmax(across, _POINT * ca.fmax(uu * vv, _POINT)))
    second = _within((uv * first + vw) / ca.fmax(vv, _POINT))
    first = _within((uv * second - uw) / ca.fmax(uu, _POINT))
    return w + first * u - second * v, second


def to_swept(a: Any, b: Any, c: Any, d: Any, motion: Any) -> tuple[Any, Any]:
    """Return the distance between a segment and the area another one sweeps, and its time.

    The swept area is a parallelogram: its closest point is on an edge, or inside, opposite an end
    of the segment or where the segment passes through.

    Args:
        a: One end of the segment, shape (3,).
        b: The other end, shape (3,).
        c: One end of the moving segment at its start, shape (3,).
        d: Its other end there, shape (3,).
        motion: Displacement of the moving segment, shape (3,).

    Returns:
        Distance, and the share of the motion at which it occurs, from 0 to 1.
    """
    found = [
        to_segment(a, b, c, c + motion),
        to_segment(a, b, d, d + motion),
        (to_segment(a, b, c, d)[0], 0.0),
        (to_segment(a, b, c + motion, d + motion)[0], 1.0),
    ]
    along = d - c
    normal = ca.cross(along, motion)
    size = ca.dot(normal, normal)
    area = ca.fmax(size, _FLAT)

    def over(p: Any) -> tuple[Any, Any, Any]:
        """Return whether a point is over the inside, its height, and the share of the motion."""
        by, share = ca.dot(ca.cross(p - c, motion), normal), ca.dot(ca.cross(along, p - c), normal)
        inside = ca.fmin(ca.fmin(by, area - by), ca.fmin(share, area - share)) >= 0.0
        inside = ca.logic_and(inside, size > _FLAT)
        return inside, ca.dot(p - c, normal) / ca.sqrt(area), share / area

    (_, low, _), (_, high, _) = over(a), over(b)
    for p in (a, b):
        inside, height, share = over(p)
        found.append((ca.if_else(inside, ca.fabs(height), ca.inf), share))
    passes = low * high < 0.0
    inside, _, share = over(a + (low / ca.if_else(passes, low - high, 1.0)) * (b - a))
    found.append((ca.if_else(ca.logic_and(passes, inside), 0.0, ca.inf), share))
    distance, when = found[0]
    for other, share in found[1:]:
        when = ca.if_else(other < distance, share, when)
        distance = ca.fmin(distance, other)
    return distance, when


def _within(share: Any) -> Any:
    return ca.fmin(ca.fmax(share, 0.0), 1.0)
