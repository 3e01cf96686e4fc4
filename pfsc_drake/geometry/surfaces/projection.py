"""Closest point on a surface."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from pfsc_drake.geometry.surfaces.surface import Surface

_MAX_ITERATIONS = 60
# All relative to the lengths of the domain.
_TOLERANCE = 1e-12
_STALLED = 1e-8
_COARSE = 1e-7
_MAX_STEP = 1.0 / 16.0
# What lies less far beyond a border is on it.
_BEYOND = 1e-9
# Smallest eigenvalue of H relative to the first form that Newton's step is taken with.
_DEFINITE = 1e-6

Pair = tuple[float, float]
Terms = tuple[float, float, float, float, float, float, float, float, float]


class SurfaceProjection(NamedTuple):
    """Result of the orthogonal projection onto a surface, (4.9).

    Attributes:
        theta: Parameters of the closest point, unwrapped in closed directions.
        distance: Of the point from there, m.
        alpha: Distance over the smallest radius of curvature towards the point; it lies in the
            feasible neighbourhood if alpha < 1, which is (4.13).
        at_border: True if the point lies beyond an end of an open direction; theta is then the
            closest point of the border.
        iterations: Number of evaluations of the surface.
        converged: False if no strict minimum was found, also for input that is not finite.
    """

    theta: Pair
    distance: float
    alpha: float
    at_border: bool
    iterations: int
    converged: bool


class SurfaceProjector:
    """Local minimum of f(theta) = |y - sigma(theta)|^2 / 2 near a guess, by Newton's method (4.48).

    The step is limited, halved while f grows, and taken with a definite matrix where H (4.12) is
    not. At an end of an open direction that f falls beyond, that parameter is kept and the other
    goes on alone. Started from the last result it follows its sheet of the surface through
    self-intersections.

    Args:
        surface: Surface of class C^2.
    """

    def __init__(self, surface: Surface) -> None:
        self._sample = surface.flat_sampler(2)
        self._domain, self._closed = surface.domain, surface.closed
        self._lengths = (surface.domain[0].length, surface.domain[1].length)

    def project(self, point: Sequence[float], theta_guess: Pair) -> SurfaceProjection:
        """Closest point near the guess.

        Args:
            point: y_t, [3], m.
            theta_guess: Unwrapped parameters to start from, as a rule the last result.

        Returns:
            The projection; `converged` is False, alpha NaN and nothing raised if the point or the
            guess is not finite.
        """
        t1, t2 = theta_guess
        point = [float(value) for value in point]
        if not (math.isfinite(t1) and math.isfinite(t2) and all(map(math.isfinite, point))):
            return SurfaceProjection((t1, t2), math.nan, math.nan, False, 0, False)
        len_1, len_2 = self._lengths
        theta = origin = self._clamped(t1, t2)
        p1 = p2 = 0.0
        least, alpha, at_border = math.inf, math.nan, False
        for iteration in range(1, _MAX_ITERATIONS + 1):
            cost, g1, g2, E, F, G, L, M, N = self._terms(theta, point)
            size = max(abs(p1) / len_1, abs(p2) / len_2)
            if cost > least and size > _COARSE:
                p1, p2 = 0.5 * p1, 0.5 * p2
                theta = (origin[0] + p1, origin[1] + p2)
                continue
            alpha = largest_eigenvalue(E, F, G, L, M, N)
            held_1, held_2 = self._held(0, theta[0], g1), self._held(1, theta[1], g2)
            beyond = max(held_1 * abs(g1) / (E * len_1), held_2 * abs(g2) / (G * len_2))
            at_border = beyond > _BEYOND
            p1, p2, strict = _step(g1, g2, E, F, G, (L, M, N), alpha, (held_1, held_2))
            scale = min(1.0, _MAX_STEP / max(abs(p1) / len_1, abs(p2) / len_2, 1e-300))
            target, met = self._inside(theta, scale * p1, scale * p2)
            p1, p2 = target[0] - theta[0], target[1] - theta[1]
            if not met and abs(p1) < _TOLERANCE * len_1 and abs(p2) < _TOLERANCE * len_2:
                distance = math.sqrt(2.0 * cost)
                return SurfaceProjection(target, distance, alpha, at_border, iteration, strict)
            origin, least = theta, cost
            theta = target
        # Near alpha = 1 rounding errors of the slope can exceed the tolerance.
        stalled = max(abs(p1) / len_1, abs(p2) / len_2) < _STALLED and alpha < 1.0
        distance = math.sqrt(2.0 * least)
        return SurfaceProjection(theta, distance, alpha, at_border, _MAX_ITERATIONS, stalled)

    def _terms(self, theta: Pair, point: Sequence[float]) -> Terms:
        """f, both of -f', first form, and second derivatives along y - sigma."""
        row = self._sample(*theta).tolist()
        x, y, z, ux, uy, uz, vx, vy, vz, ax, ay, az, bx, by, bz, cx, cy, cz = row
        x, y, z = point[0] - x, point[1] - y, point[2] - z
        return (
            0.5 * (x * x + y * y + z * z),
            x * ux + y * uy + z * uz,
            x * vx + y * vy + z * vz,
            ux * ux + uy * uy + uz * uz,
            ux * vx + uy * vy + uz * vz,
            vx * vx + vy * vy + vz * vz,
            x * ax + y * ay + z * az,
            x * bx + y * by + z * bz,
            x * cx + y * cy + z * cz,
        )

    def _clamped(self, t1: float, t2: float) -> Pair:
        (begin_1, end_1), (begin_2, end_2) = self._domain
        if not self._closed[0]:
            t1 = begin_1 if t1 < begin_1 else end_1 if t1 > end_1 else t1
        if not self._closed[1]:
            t2 = begin_2 if t2 < begin_2 else end_2 if t2 > end_2 else t2
        return t1, t2

    def _held(self, axis: int, value: float, descent: float) -> bool:
        """Whether f falls beyond the end of an open direction that theta is at."""
        if self._closed[axis]:
            return False
        begin, end = self._domain[axis]
        return (value <= begin and descent < 0.0) or (value >= end and descent > 0.0)

    def _inside(self, theta: Pair, p1: float, p2: float) -> tuple[Pair, bool]:
        """Where a step leads to, or its way to the first border it meets, and whether it met one.

        A step out of a border that theta is on already goes along it.
        """
        share, step, met = 1.0, [p1, p2], -1
        for k in (0, 1):
            begin, end = self._domain[k]
            if self._closed[k] or not step[k]:
                continue
            room = (end if step[k] > 0.0 else begin) - theta[k]
            if not room:
                step[k] = 0.0
            elif room / step[k] < share:
                share, met = room / step[k], k
        target = list(self._clamped(theta[0] + share * step[0], theta[1] + share * step[1]))
        if met >= 0:
            target[met] = self._domain[met][step[met] > 0.0]
        return (target[0], target[1]), met >= 0


def _step(
    g1: float,
    g2: float,
    E: float,
    F: float,
    G: float,
    bend: tuple[float, float, float],
    alpha: float,
    held: tuple[bool, bool],
) -> tuple[float, float, bool]:
    """Newton's step of the parameters that are not held, and whether the minimum is strict."""
    L, M, N = bend
    if held[0] and held[1]:
        return 0.0, 0.0, True
    if held[0]:
        return 0.0, g2 / (abs(G - N) or G), G > N
    if held[1]:
        return g1 / (abs(E - L) or E), 0.0, E > L
    # alpha is the largest eigenvalue of the bend relative to the first form.
    shift = 0.0 if alpha < 1.0 - _DEFINITE else 2.0 * (alpha - 1.0) + 2.0 * _DEFINITE
    h11, h12, h22 = (1.0 + shift) * E - L, (1.0 + shift) * F - M, (1.0 + shift) * G - N
    det = h11 * h22 - h12 * h12
    return (h22 * g1 - h12 * g2) / det, (h11 * g2 - h12 * g1) / det, alpha < 1.0


def largest_eigenvalue(E: float, F: float, G: float, L: float, M: float, N: float) -> float:
    """Return that of a form L, M, N relative to the first one, as `curvature.mean_and_spread`."""
    determinant = E * G - F * F
    along = L / E
    mixed = M - F * along
    across = (N * E - 2.0 * F * M + F * F * along) / determinant
    half = 0.5 * (along - across)
    return 0.5 * (along + across) + math.sqrt(half * half + mixed * mixed / determinant)
