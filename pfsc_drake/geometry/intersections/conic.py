"""Lines, circles and ellipses, known by their points."""

import math

import numpy as np

from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.fourier import FourierCurve
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve

# Of the size of a curve: how far from it its points may be.
_EXACT = 1e-10


def line_or_ellipse(points: np.ndarray, is_closed: bool) -> Curve | None:
    """The straight line, circle or ellipse that points are on, or None if they are on none.

    It begins at the first point and goes the way of the others; points are off it by 1e-10 of
    its size at most.

    Args:
        points: Along a curve, exact, five or more if it is closed, [n, 3], m.
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
    """The ellipse in a plane through ``middle + points @ axes``, or None."""
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
    way = 1.0 if np.cross([*unit[0], 0.0], [*unit[1], 0.0])[2] > 0.0 else -1.0
    cosine, sine = math.cos(begin), math.sin(begin)
    turned = root @ np.array([[cosine, -way * sine], [sine, way * cosine]])
    return FourierCurve(
        middle + scale * center @ axes, [scale * turned[:, 0] @ axes], [scale * turned[:, 1] @ axes]
    )
