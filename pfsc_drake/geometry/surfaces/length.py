"""The tangential coordinates (4.15): lengths in two orthogonal directions of the tangent plane."""

from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.surfaces.parametric_surface import Surface

# Longest panel of the integral, relative to the lengths of the domain, and panels of a long line.
_PANEL, _PANELS = 1.0 / 64.0, 64


class TangentialLength:
    """Integral of eta' = Sigma theta' (4.15) along straight lines of the parameters.

    Each panel uses Sigma and its derivative at both ends, which is exact for cubics. On a curved
    surface eta depends on the path of theta. The motion of a tick is one panel; longer lines have a
    fixed number of panels, which are short over one length of the domain.

    Args:
        terms: theta -> partial derivatives up to order 2 as columns, shapes (2,) and (3, 6).
        lengths: Lengths of the domain in both parameters.
    """

    def __init__(self, terms: Callable[[ca.MX], ca.MX], lengths: ArrayLike) -> None:
        self._lengths = ca.DM(np.asarray(lengths, dtype=float))
        panel = panel_function()
        first, last = ca.MX.sym("first", 2), ca.MX.sym("last", 2)
        between = [terms(first), terms(last)]
        one = ca.Function("panel", [first, last], [panel(*between, last - first)])
        shares = ca.DM([k / _PANELS for k in range(_PANELS + 1)]).T
        points = first + (last - first) @ shares
        many = ca.sum2(one.map(_PANELS)(points[:, :-1], points[:, 1:]))
        terms_1, terms_2 = ca.MX.sym("terms_1", 3, 6), ca.MX.sym("terms_2", 3, 6)
        arguments = [first, last, terms_1, terms_2]
        self._advance = ca.Function.if_else(
            "tangential_length",
            ca.Function("one_panel", arguments, [panel(terms_1, terms_2, last - first)]),
            ca.Function("many_panels", arguments, [many]),
        )

    def __call__(
        self, begin: ca.MX, end: ca.MX, terms_at_begin: ca.MX, terms_at_end: ca.MX
    ) -> ca.MX:
        """Return the change of the tangential coordinates along a straight line [m], shape (2,).

        Args:
            begin: Unwrapped parameters, in the domain in open directions, shape (2,).
            end: The same where the line ends.
            terms_at_begin: Partial derivatives there, shape (3, 6).
            terms_at_end: The same where the line ends.
        """
        is_short = ca.norm_inf((end - begin) / self._lengths) <= _PANEL
        return self._advance(is_short, begin, end, terms_at_begin, terms_at_end)


@cache
def panel_function() -> ca.Function:
    """Return ``(terms at begin, terms at end, d theta) -> integral of Sigma d theta`` [m].

    The line is straight; shapes (3, 6), (3, 6), (2,) and (2,).
    """
    begin, end = ca.SX.sym("begin", 3, 6), ca.SX.sym("end", 3, 6)
    step = ca.SX.sym("way", 2)
    (a, a_rate), (b, b_rate) = _rates(begin, step), _rates(end, step)
    length = 0.5 * (a + b) + (a_rate - b_rate) / 12.0
    return ca.Function("panel_length", [begin, end, step], [length], {"cse": True})


def _rates(terms: ca.SX, step: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return Sigma d (4.15), m, and its derivative by the share of the step, m, each (2,)."""
    _, u, v, a, b, c = ca.horzsplit(terms)
    d1, d2 = ca.vertsplit(step)
    # Derivatives of the tangents along d.
    p, q = a * d1 + b * d2, b * d1 + c * d2
    E, F, G = ca.dot(u, u), ca.dot(u, v), ca.dot(v, v)
    half_E_rate, F_rate = ca.dot(u, p), ca.dot(p, v) + ca.dot(u, q)
    half_G_rate = ca.dot(v, q)
    norm, skew = ca.sqrt(E), F / E
    across = ca.sqrt(G - F * skew)
    norm_rate = half_E_rate / norm
    across_rate = (half_G_rate - skew * (F_rate - skew * half_E_rate)) / across
    return (
        ca.vertcat(norm * d1 + skew * norm * d2, across * d2),
        ca.vertcat(
            norm_rate * d1 + (F_rate / norm - skew * norm_rate) * d2,
            across_rate * d2,
        ),
    )


def parameters_along_motion(
    surface: Surface, motion: PiecewisePolynomialCurve, start: np.ndarray, times: np.ndarray
) -> Iterator[np.ndarray]:
    """Iterate over the parameters theta of tangential coordinates over time, each [2].

    ``theta' = Sigma(theta)^-1 eta'`` (4.15), integrated by Runge and Kutta's method of fourth order
    from time to time. Beyond the ends of open directions Sigma is evaluated at the border.

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
    """Return Sigma of (4.15), shape (2, 2)."""
    inside = [
        value if closed else min(max(value, ends.begin), ends.end)
        for value, ends, closed in zip(theta, surface.domain, surface.closed, strict=True)
    ]
    s_1, s_2 = surface.partials(np.array(inside), 1)[1:]
    speed = np.linalg.norm(s_1)
    along = s_1 @ s_2 / speed
    return np.array([[speed, along], [0.0, np.linalg.norm(np.cross(s_1, s_2)) / speed]])
