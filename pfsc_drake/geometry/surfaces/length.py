"""The tangential coordinates (4.15): lengths in two orthogonal directions of the tangent plane."""

import math
from collections.abc import Sequence

from pfsc_drake.geometry.surfaces.surface import Surface

# Longest panel of the integral, relative to the lengths of the domain.
_PANEL = 1.0 / 64.0

Pair = tuple[float, float]
Rates = tuple[float, float, float, float]


class TangentialLength:
    """Integrates eta' = Sigma theta' (4.15) along straight lines of the parameters.

    Each panel takes Sigma and its derivative at both ends, which is exact for cubics. How eta
    depends on theta depends on the way, as the surface is curved.

    Args:
        surface: Surface of class C^2.
    """

    def __init__(self, surface: Surface) -> None:
        self._sample = surface.flat_sampler(2)
        self._domain, self._closed = surface.domain, surface.closed

    def advance(self, eta: Sequence[float], begin: Sequence[float], end: Sequence[float]) -> Pair:
        """Tangential coordinates at the end of a straight line.

        Args:
            eta: Those at its begin, [2], m.
            begin: Unwrapped parameters; clamped to the domain in open directions.
            end: Unwrapped parameters in the domain.

        Returns:
            The coordinates, m.
        """
        start = [
            value if closed else min(max(value, ends.begin), ends.end)
            for value, ends, closed in zip(begin, self._domain, self._closed, strict=True)
        ]
        way = [last - first for first, last in zip(start, end, strict=True)]
        share = max(abs(way[k]) / ends.length for k, ends in enumerate(self._domain))
        panels = max(1, math.ceil(share / _PANEL))
        d1, d2 = way[0] / panels, way[1] / panels
        e1, e2 = eta
        here = self._sample(start[0], start[1]).tolist()
        for k in range(1, panels + 1):
            there = self._sample(start[0] + k * d1, start[1] + k * d2).tolist()
            more_1, more_2 = panel(here, there, d1, d2)
            e1, e2, here = e1 + more_1, e2 + more_2, there
        return e1, e2


def panel(begin: Sequence[float], end: Sequence[float], d1: float, d2: float) -> Pair:
    """Return the integral of Sigma d theta (4.15) over one straight step, m.

    Args:
        begin: Partial derivatives up to order 2 where it begins, flat, [18].
        end: The same where it ends.
        d1: Step of theta_1.
        d2: Step of theta_2.
    """
    a1, a2, a1_rate, a2_rate = _rates(begin, d1, d2)
    b1, b2, b1_rate, b2_rate = _rates(end, d1, d2)
    return (
        0.5 * (a1 + b1) + (a1_rate - b1_rate) / 12.0,
        0.5 * (a2 + b2) + (a2_rate - b2_rate) / 12.0,
    )


def _rates(terms: Sequence[float], d1: float, d2: float) -> Rates:
    """Both components of Sigma d (4.15), m, and of its derivative by the share of the step, m."""
    _, _, _, ux, uy, uz, vx, vy, vz, ax, ay, az, bx, by, bz, cx, cy, cz = terms
    # Derivatives of the tangents along d.
    px, py, pz = ax * d1 + bx * d2, ay * d1 + by * d2, az * d1 + bz * d2
    qx, qy, qz = bx * d1 + cx * d2, by * d1 + cy * d2, bz * d1 + cz * d2
    E = ux * ux + uy * uy + uz * uz
    F = ux * vx + uy * vy + uz * vz
    G = vx * vx + vy * vy + vz * vz
    half_E_rate = ux * px + uy * py + uz * pz
    F_rate = px * vx + py * vy + pz * vz + ux * qx + uy * qy + uz * qz
    half_G_rate = vx * qx + vy * qy + vz * qz
    norm, skew = math.sqrt(E), F / E
    across = math.sqrt(G - F * skew)
    norm_rate = half_E_rate / norm
    across_rate = (half_G_rate - skew * (F_rate - skew * half_E_rate)) / across
    mixed = skew * norm
    return (
        norm * d1 + mixed * d2,
        across * d2,
        norm_rate * d1 + (F_rate / norm - skew * norm_rate) * d2,
        across_rate * d2,
    )
