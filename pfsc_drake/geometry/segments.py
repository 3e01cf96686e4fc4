"""Distances between points, lines of finite length and what they sweep, as expressions."""

from typing import Any

import casadi as ca

# m^2, below which a segment is a point
_POINT = 1e-12


def to_point(a: Any, b: Any, p: Any) -> Any:
    """Return the distance of a point from a segment.

    Args:
        a: One end of the segment, shape (k,).
        b: The other one, shape (k,).
        p: The point, shape (k,).
    """
    along, away = b - a, p - a
    share = _within(ca.dot(away, along) / ca.fmax(ca.dot(along, along), _POINT))
    return ca.norm_2(away - share * along)


def to_segment(a: Any, b: Any, c: Any, d: Any) -> tuple[Any, Any]:
    """Return the distance between two segments, and at which share of the second one it is.

    See Ericson, Real-Time Collision Detection (2005), Sec. 5.1.9.

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
    # of parallel ones any place does
    first = _within((uv * vw - uw * vv) / ca.fmax(across, _POINT * ca.fmax(uu * vv, _POINT)))
    second = _within((uv * first + vw) / ca.fmax(vv, _POINT))
    first = _within((uv * second - uw) / ca.fmax(uu, _POINT))
    return ca.norm_2(w + first * u - second * v), second


def _within(share: Any) -> Any:
    return ca.fmin(ca.fmax(share, 0.0), 1.0)
