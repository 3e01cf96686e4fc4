"""Projection onto a surface and its quantities there, at each tick."""

import math
from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.closest_point import ClosestPoint, ClosestPointFinder
from pfsc_drake.geometry.manifold_point import ManifoldEvaluator, SurfacePointLayout, alpha_function
from pfsc_drake.geometry.nearest_samples import ProjectionStatus, nearest_samples
from pfsc_drake.geometry.surfaces.extended import ExtendedSurface, SurfaceTable
from pfsc_drake.geometry.surfaces.length import TangentialLength
from pfsc_drake.geometry.surfaces.parametric_surface import Surface, partial_count
from pfsc_drake.geometry.surfaces.product import ProductSurface, checked_product
from pfsc_drake.geometry.surfaces.surface_projection import (
    LONGEST_STEP,
    GlobalProjector,
    SurfaceProjection,
)

# Of the lengths of the domain: motion in a tick that triggers a global search.
_FAR = 1.0 / 8.0
# Negligible relative difference of distances.
_NOT_NEARER = 1e-9
# Samples in each direction of that search.
_MOST_SAMPLES = 24
# Of the domain: samples that are nearer to each other lead to one closest point.
_VALLEY = 1.0 / 8.0


@once_per_content()
def _whole(surface: ProductSurface, smoothness: int) -> ExtendedSurface:
    """Return a surface extended beyond its ends."""
    return ExtendedSurface(surface, smoothness)


class SurfaceEvaluator(ManifoldEvaluator[SurfacePointLayout]):
    """Projection of a point onto a surface, and all quantities there that a law of one order needs.

    `ClosestPointFinder` starts from the last tick's parameters; if it fails or moves far, the whole
    surface is searched. Beyond an end of an open direction the surface is extended as
    `ExtendedSurface`, which the status reports; beyond the extension the projection is the closest
    point of its border. The memory is theta and eta: eta is the integral of Sigma (4.15) along
    straight lines of the parameters, of fourth order.

    Args:
        surface: Surface of class C^(order + 1), at least C^2.
        order: Relative degree r of the law, 1..5.
        orientation: Constant quaternion (w, x, y, z) of the reference orientation, [4], or None.

    Attributes:
        surface: The surface.

    Raises:
        InputError: A surface that is not smooth enough or not regular, or an invalid orientation.
    """

    def __init__(self, surface: Surface, order: int, orientation: ArrayLike | None = None) -> None:
        layout = SurfacePointLayout(order, orientation is not None)
        super().__init__(layout, surface.domain, surface.closed, surface, order, orientation)
        if surface.smoothness < order + 1:
            raise InputError(
                f"surface: class C^{surface.smoothness:g}; C^{order + 1} or smoother is required"
                f" for a law of order {order}"
            )
        self.surface = surface
        self._quaternion = np.zeros(self.layout.quaternion.stop - self.layout.quaternion.start)
        if orientation is not None:
            self._quaternion[:4] = _checked_quaternion(orientation)
        self._global = GlobalProjector(surface)
        whole = _whole(checked_product(surface), order + 1)
        self._table = SurfaceTable(whole)
        self._finder = ClosestPointFinder(self._terms, whole.domain, whole.closed, LONGEST_STEP)
        self._lengths = np.array([ends.length for ends in surface.domain])
        self._tangential_length = TangentialLength(self._terms, self._lengths)

    def _nearest(self, y: ca.MX) -> ca.MX:
        """Return the wrapped parameters of the whole surface's closest point, and zeros."""
        grid = self._global.grid
        starts = nearest_samples(
            y, grid.theta.reshape(-1, 2), grid.position.reshape(-1, 3), _VALLEY * self._lengths
        )
        theta = self._finder.nearest(y, starts)
        wrapped = []
        for k, ((begin, _), length) in enumerate(zip(self._domain, self._lengths, strict=True)):
            revolutions = ca.floor((theta[k] - begin) / length) if self._closed[k] else 0.0
            wrapped.append(theta[k] - revolutions * length)
        return ca.vertcat(*wrapped, 0.0, 0.0)

    def _on(self, memory: ca.MX) -> ca.MX:
        """Return the surface point at unwrapped parameters, with alpha zero and status OK."""
        rows = ca.vec(self._table(memory[:2], self.layout.order + 1))
        return ca.vertcat(memory, 0.0, float(ProjectionStatus.OK), rows, self._quaternion)

    def evaluate_at(self, theta: Sequence[float], eta: Sequence[float] = (0.0, 0.0)) -> np.ndarray:
        """Return the surface point at a point on the surface, for set-up.

        Args:
            theta: Unwrapped parameters, [2].
            eta: Tangential coordinates there, [2], m.

        Returns:
            New array [layout.size], with alpha zero.

        Raises:
            InputError: theta is not finite or lies outside the domain of an open direction.
        """
        self.surface.to_domain(np.asarray(theta, dtype=float))
        return np.array(self.at(ca.DM([*theta, *eta]))).ravel()

    def project_globally(self, point: ArrayLike) -> SurfaceProjection:
        """Return the closest point of the whole surface, see `GlobalProjector.project`."""
        return self._global.project(point)

    def _terms(self, theta: ca.MX) -> ca.MX:
        return self._table(theta, 2)

    def _at_closest(self, y: ca.MX, memory: ca.MX) -> ca.MX:
        """Return the surface point at the closest point to y."""
        guess, eta = ca.vertsplit(memory, 2)
        near = self._finder.find(y, guess)
        is_far = ca.norm_inf((near.theta - guess) / self._lengths) > _FAR
        is_lost = ca.logic_and(near.known, ca.logic_or(is_far, ca.logic_not(near.converged)))
        closest_point = ClosestPoint(
            self._search()(is_lost, near.state, y, guess), self._finder.lengths
        )
        rows = self._table(closest_point.theta, self.layout.order + 1)
        terms = rows[:, : partial_count(2)]
        begin = self._finder.clamp(guess)
        eta = eta + self._tangential_length(begin, closest_point.theta, self._terms(begin), terms)
        head = ca.vertcat(closest_point.theta, eta, alpha_function(2)(y, terms))
        known = ca.logic_and(closest_point.known, ca.fabs(ca.sum1(memory)) < math.inf)
        return self._with_status(
            ca.vertcat(head, ca.vec(rows), self._quaternion), closest_point, known
        )

    def _search(self) -> ca.Function:
        """Return ``(is_lost, state, y, guess) -> state`` of the whole surface's closest point.

        It is the one found near the guess, unless another is nearer.
        """
        state, y = ca.MX.sym("state", self._finder.size), ca.MX.sym("y", 3)
        guess, grid = ca.MX.sym("guess", 2), self._global.grid
        strides = [-(-n // _MOST_SAMPLES) for n in grid.position.shape[:2]]
        part = (slice(None, None, strides[0]), slice(None, None, strides[1]))
        starts = nearest_samples(
            y, grid.theta[part].reshape(-1, 2), grid.position[part].reshape(-1, 3), self._lengths
        )
        best, found = self._finder.find(y, starts[0]), ClosestPoint(state, self._finder.lengths)
        nearer = best.rank < found.rank * (1.0 - _NOT_NEARER)
        revolutions = ca.floor((guess - best.theta) / self._lengths + 0.5) * self._lengths
        theta = best.theta + revolutions * np.array(self._closed, dtype=float)
        other = ca.vertcat(theta, best.state[2:])
        arguments = [state, y, guess]
        return ca.Function.if_else(
            "nearest_of_all",
            ca.Function("search", arguments, [ca.if_else(nearer, other, state)]),
            ca.Function("stay", arguments, [state]),
        )


def _checked_quaternion(values: ArrayLike) -> np.ndarray:
    q = np.asarray(values, dtype=float)
    if q.shape != (4,) or not np.all(np.isfinite(q)) or not np.linalg.norm(q) > 1e-6:
        raise InputError(
            f"surface orientation: {q.tolist()}; a quaternion (w, x, y, z) of 4 finite numbers,"
            " not all zero, is required"
        )
    return q
