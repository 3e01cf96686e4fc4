"""What a surface tells the controller at each tick."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.projection_status import ProjectionStatus
from pfsc_drake.geometry.surfaces.extended import ExtendedSurface
from pfsc_drake.geometry.surfaces.length import TangentialLength, panel
from pfsc_drake.geometry.surfaces.point import SurfacePointLayout
from pfsc_drake.geometry.surfaces.product import ProductSurface
from pfsc_drake.geometry.surfaces.projection import (
    SurfaceProjection,
    SurfaceProjector,
    largest_eigenvalue,
)
from pfsc_drake.geometry.surfaces.start import GlobalProjector
from pfsc_drake.geometry.surfaces.surface import Surface

_BEYOND_END = float(ProjectionStatus.BEYOND_END)
_NOT_CONVERGED = float(ProjectionStatus.NOT_CONVERGED)

# All relative to the lengths of the domain: the longest step from one tick to the next, ...
_NEAR = 1.0 / 32.0
# ... one whose square counts, ...
_SETTLED = 1e-6
# ... a step that is not worth another evaluation, ...
_TOLERANCE = 1e-12
# ... and a way after which it is asked whether another place has become nearer.
_FAR = 1.0 / 8.0
# Relative difference of distances that is none.
_NOT_NEARER = 1e-9
_MAX_STEPS = 8
# Squared ratio of successive steps that is quick.
_QUICK = 1.0 / 16.0

Pair = tuple[float, float]


class SurfaceEvaluator:
    """Projects a point on a surface and evaluates everything a law of one order needs there.

    It has no memory: the same input gives the same output. From the last tick's parameters plain
    Newton steps (4.48) find the foot in a few scalar operations; whatever is not quick and plain (a
    far guess, a border, a point near the centre of curvature) is left to the
    `SurfaceProjector`, and what that does not find to a search of the whole surface. Beyond an end
    of an open direction a sum of products goes on as `ExtendedSurface`, and the status tells; where
    that ends too, and with surfaces of other kinds, the border's closest point is the foot.

    Args:
        surface: Surface of class C^(order + 1), at least C^2.
        order: Relative degree r of the law, 1..5.
        orientation: Constant quaternion (w, x, y, z) of the reference orientation, [4], or None.

    Attributes:
        layout: Where the quantities lie in the arrays returned.
        surface: The surface.

    Raises:
        InputError: A surface that is not smooth enough or not regular, or an orientation that is
            none.
    """

    def __init__(self, surface: Surface, order: int, orientation: ArrayLike | None = None) -> None:
        self.layout = SurfacePointLayout(order, orientation is not None)
        if surface.smoothness < order + 1:
            raise InputError(
                f"surface: class C^{surface.smoothness:g}; C^{order + 1} or smoother is required"
                f" for a law of order {order}"
            )
        self.surface = surface
        self._global = GlobalProjector(surface)
        whole = surface
        if isinstance(surface, ProductSurface):
            whole = ExtendedSurface(surface, order + 1)
        self._project = SurfaceProjector(whole).project
        self._sample = whole.flat_sampler(order + 1)
        self._length = TangentialLength(whole)
        self._blank = np.zeros(self.layout.size)
        if orientation is not None:
            begin = self.layout.quaternion.start
            self._blank[begin : begin + 4] = _checked_quaternion(orientation)
        self._head = self.layout.position.start
        self._rest = self.layout.position.stop
        first, second = surface.domain
        self._lengths = (first.length, second.length)
        self._bounds = tuple(
            (-math.inf, math.inf) if closed else tuple(ends)
            for ends, closed in zip(whole.domain, whole.closed, strict=True)
        )

    def __call__(
        self, point: Sequence[float], theta_guess: Sequence[float], eta_last: Sequence[float]
    ) -> np.ndarray:
        """Surface quantities at the projection of a point.

        Args:
            point: y_t, [3], m. A list or tuple of floats is faster than an array.
            theta_guess: Unwrapped parameters of the last tick, [2].
            eta_last: Tangential coordinates there, [2], m; they go on by the integral of Sigma
                (4.15) along the straight line of the parameters, of fourth order.

        Returns:
            New array [layout.size], see `SurfacePointLayout`. All its values but `status` are
            NaN if the point, the guess or eta is not finite.
        """
        x, y, z = point
        g1, g2 = t1, t2 = theta_guess
        len_1, len_2 = self._lengths
        (begin_1, end_1), (begin_2, end_2) = self._bounds
        sample, before, start = self._sample, _NEAR * _NEAR, None
        for _ in range(_MAX_STEPS):
            if not (begin_1 <= t1 <= end_1 and begin_2 <= t2 <= end_2 and abs(t1 + t2) < math.inf):
                break
            rows = sample(t1, t2)
            terms = rows[:18].tolist()
            px, py, pz, ux, uy, uz, vx, vy, vz, ax, ay, az, bx, by, bz, cx, cy, cz = terms
            if start is None:
                start = terms
            px, py, pz = x - px, y - py, z - pz
            E = ux * ux + uy * uy + uz * uz
            F = ux * vx + uy * vy + uz * vz
            G = vx * vx + vy * vy + vz * vz
            L = px * ax + py * ay + pz * az
            M = px * bx + py * by + pz * bz
            N = px * cx + py * cy + pz * cz
            f1 = px * ux + py * uy + pz * uz
            f2 = px * vx + py * vy + pz * vz
            h11, h12, h22 = E - L, F - M, G - N
            det = h11 * h22 - h12 * h12
            if not (det > 0.0 and h11 > 0.0):
                break
            s1, s2 = (h22 * f1 - h12 * f2) / det, (h11 * f2 - h12 * f1) / det
            r1, r2 = s1 / len_1, s2 / len_2
            size = r1 * r1 + r2 * r2
            if size > _SETTLED * _SETTLED:
                # How the residual bends on the way, without the part that d . sigma_ijk has in it.
                wx, wy, wz = ux * s1 + vx * s2, uy * s1 + vy * s2, uz * s1 + vz * s2
                ax, ay, az = ax * s1 + bx * s2, ay * s1 + by * s2, az * s1 + bz * s2
                bx, by, bz = bx * s1 + cx * s2, by * s1 + cy * s2, bz * s1 + cz * s2
                qx = 0.5 * (ax * s1 + bx * s2)
                qy = 0.5 * (ay * s1 + by * s2)
                qz = 0.5 * (az * s1 + bz * s2)
                f1 -= wx * ax + wy * ay + wz * az + qx * ux + qy * uy + qz * uz
                f2 -= wx * bx + wy * by + wz * bz + qx * vx + qy * vy + qz * vz
                s1, s2 = (h22 * f1 - h12 * f2) / det, (h11 * f2 - h12 * f1) / det
            t1 += s1
            t2 += s2
            if size < _TOLERANCE * _TOLERANCE:
                e1, e2 = eta_last
                more_1, more_2 = panel(start, terms, t1 - g1, t2 - g2)
                e1 += more_1
                e2 += more_2
                inside = begin_1 <= t1 <= end_1 and begin_2 <= t2 <= end_2
                alpha = largest_eigenvalue(E, F, G, L, M, N)
                if not (inside and abs(e1 + e2 + alpha) < math.inf):
                    break
                out = self._blank.copy()
                out[:6] = (t1, t2, e1, e2, alpha, self._status(t1, t2))
                out[6 : self._rest] = rows
                return out
            if not size < before:
                break
            before = _QUICK * size
        return self._at_projection(point, (g1, g2), eta_last)

    def evaluate_at(self, theta: Sequence[float], eta: Sequence[float] = (0.0, 0.0)) -> np.ndarray:
        """Surface quantities at a point on the surface, for set-up.

        Args:
            theta: Unwrapped parameters, [2].
            eta: Tangential coordinates there, [2], m.

        Returns:
            New array [layout.size], with alpha zero.

        Raises:
            InputError: theta is not finite or lies outside the domain of an open direction.
        """
        self.surface.checked(np.asarray(theta, dtype=float))
        return self._at(theta, eta, 0.0, 0.0)

    def project_globally(self, point: ArrayLike) -> SurfaceProjection:
        """The closest point of the whole surface, see `GlobalProjector.project`."""
        return self._global.project(point)

    def _at(
        self, theta: Sequence[float], eta: Sequence[float], alpha: float, status: float
    ) -> np.ndarray:
        out = self._blank.copy()
        out[: self._head] = (*theta, *eta, alpha, status)
        out[self._head : self._rest] = self._sample(float(theta[0]), float(theta[1]))
        return out

    def _at_projection(
        self, point: Sequence[float], theta_guess: Pair, eta_last: Sequence[float]
    ) -> np.ndarray:
        """The same as a call, by the projector or a search of the whole surface."""
        foot = self._project(point, theta_guess)
        if not math.isfinite(foot.distance + foot.alpha + eta_last[0] + eta_last[1]):
            out = np.full(self.layout.size, math.nan)
            out[self.layout.status] = _NOT_CONVERGED
            return out
        way = max(
            abs(foot.theta[k] - theta_guess[k]) / length for k, length in enumerate(self._lengths)
        )
        if way > _FAR or not foot.converged:
            best = self._global.feet(point)[0]
            nearer = best.distance < foot.distance * (1.0 - _NOT_NEARER)
            if best.converged and (nearer or not foot.converged):
                foot = best._replace(theta=self._nearest_lap(best.theta, theta_guess))
        status = _BEYOND_END if foot.at_border else self._status(*foot.theta)
        eta = self._length.advance(eta_last, theta_guess, foot.theta)
        return self._at(foot.theta, eta, foot.alpha, status if foot.converged else _NOT_CONVERGED)

    def _status(self, theta_1: float, theta_2: float) -> float:
        """Whether a place is beyond the end of an open direction."""
        (begin_1, end_1), (begin_2, end_2) = self.surface.domain
        closed_1, closed_2 = self.surface.closed
        inside = (closed_1 or begin_1 <= theta_1 <= end_1) and (
            closed_2 or begin_2 <= theta_2 <= end_2
        )
        return 0.0 if inside else _BEYOND_END

    def _nearest_lap(self, theta: Pair, guess: Pair) -> Pair:
        """Parameters moved by whole periods next to a guess."""
        first, second = (
            value + length * round((near - value) / length) if closed else value
            for value, near, length, closed in zip(
                theta, guess, self._lengths, self.surface.closed, strict=True
            )
        )
        return first, second


def _checked_quaternion(values: ArrayLike) -> np.ndarray:
    q = np.asarray(values, dtype=float)
    if q.shape != (4,) or not np.all(np.isfinite(q)) or not np.linalg.norm(q) > 1e-6:
        raise InputError(
            f"surface orientation: {q.tolist()}; a quaternion (w, x, y, z) of 4 finite numbers,"
            " not all zero, is required"
        )
    return q
