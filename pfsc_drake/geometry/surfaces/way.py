"""Where tangential coordinates lead to on a surface."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.surfaces.surface import Surface


def way_on_surface(
    surface: Surface, motion: PiecewisePolynomialCurve, start: np.ndarray, times: np.ndarray
) -> Iterator[np.ndarray]:
    """Yield the parameters theta that belong to tangential coordinates over time, each [2].

    ``theta' = Sigma(theta)^-1 eta'`` (4.15), integrated by Runge and Kutta's method of fourth order
    from time to time. Beyond the ends of open directions Sigma is that of the border.

    Args:
        surface: The surface.
        motion: (eta_1, eta_2) over time, m over s.
        start: theta at the first time, [2].
        times: s, increasing, within the motion's domain.
    """
    theta = np.array(start, dtype=float)
    yield theta

    def slope(t: float, at: np.ndarray) -> np.ndarray:
        rate = motion.derivatives(np.array([t]), 1)[0, 1]
        return np.linalg.solve(_sigma(surface, at), rate)

    for begin, end in pairwise(times):
        h = end - begin
        k_1 = slope(begin, theta)
        k_2 = slope(begin + h / 2.0, theta + h / 2.0 * k_1)
        k_3 = slope(begin + h / 2.0, theta + h / 2.0 * k_2)
        k_4 = slope(end, theta + h * k_3)
        theta = theta + h / 6.0 * (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4)
        yield theta


def _sigma(surface: Surface, theta: np.ndarray) -> np.ndarray:
    """Sigma of (4.15), shape (2, 2)."""
    inside = [
        value if closed else min(max(value, ends.begin), ends.end)
        for value, ends, closed in zip(theta, surface.domain, surface.closed, strict=True)
    ]
    s_1, s_2 = surface.partials(np.array(inside), 1)[1:]
    speed = np.linalg.norm(s_1)
    along = s_1 @ s_2 / speed
    return np.array([[speed, along], [0.0, np.linalg.norm(np.cross(s_1, s_2)) / speed]])
