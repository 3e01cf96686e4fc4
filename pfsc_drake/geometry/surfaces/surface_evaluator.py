"""What a surface tells the controller at each tick."""

import math
from collections.abc import Sequence

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.foot import Foot, FootFinder
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

# Of the lengths of the domain: a way after which it is asked whether another place is nearer.
_FAR = 1.0 / 8.0
# Relative difference of distances that is none.
_NOT_NEARER = 1e-9
# Samples in each direction that are looked at then.
_MOST_SAMPLES = 24
# Of the domain: samples that are nearer to each other lead to one place.
_VALLEY = 1.0 / 8.0


@once_per_content()
def _whole(surface: ProductSurface, smoothness: int) -> ExtendedSurface:
    """Return a surface and what it goes on to beyond its ends."""
    return ExtendedSurface(surface, smoothness)


class SurfaceEvaluator(ManifoldEvaluator[SurfacePointLayout]):
    """Projects a point on a surface and evaluates everything a law of one order needs there.

    The foot is found by `FootFinder` from the last tick's parameters; what is far from there, or
    not found, is looked for on the whole surface. Beyond an end of an open direction the surface
    goes on as `ExtendedSurface`, and the status tells; where that ends too, the border's closest
    point is the foot. Its memory is theta and eta: eta goes on by the integral of Sigma (4.15)
    along the straight line of the parameters, of fourth order.

    Args:
        surface: Surface of class C^(order + 1), at least C^2.
        order: Relative degree r of the law, 1..5.
        orientation: Constant quaternion (w, x, y, z) of the reference orientation, [4], or None.

    Attributes:
        surface: The surface.

    Raises:
        InputError: A surface that is not smooth enough or not regular, or an orientation that is
            none.
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
        self._finder = FootFinder(self._terms, whole.domain, whole.closed, LONGEST_STEP)
        self._lengths = np.array([ends.length for ends in surface.domain])
        self._way = TangentialLength(self._terms, self._lengths)

    def _nearest(self, y: ca.MX) -> ca.MX:
        """Parameters of the nearest point of the whole surface, on the first laps, and zeros."""
        grid = self._global.grid
        starts = nearest_samples(
            y, grid.theta.reshape(-1, 2), grid.position.reshape(-1, 3), _VALLEY * self._lengths
        )
        theta = self._finder.nearest(y, starts)
        wrapped = []
        for k, ((begin, _), length) in enumerate(zip(self._domain, self._lengths, strict=True)):
            laps = ca.floor((theta[k] - begin) / length) if self._closed[k] else 0.0
            wrapped.append(theta[k] - laps * length)
        return ca.vertcat(*wrapped, 0.0, 0.0)

    def _on(self, memory: ca.MX) -> ca.MX:
        """Surface point at unwrapped parameters, with alpha zero and status OK."""
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
        self.surface.checked(np.asarray(theta, dtype=float))
        return np.array(self.at(ca.DM([*theta, *eta]))).ravel()

    def project_globally(self, point: ArrayLike) -> SurfaceProjection:
        """The closest point of the whole surface, see `GlobalProjector.project`."""
        return self._global.project(point)

    def _terms(self, theta: ca.MX) -> ca.MX:
        return self._table(theta, 2)

    def _at_foot(self, y: ca.MX, memory: ca.MX) -> ca.MX:
        """Surface point at the foot of a point."""
        guess, eta = ca.vertsplit(memory, 2)
        near = self._finder.find(y, guess)
        is_far = ca.norm_inf((near.theta - guess) / self._lengths) > _FAR
        is_lost = ca.logic_and(near.known, ca.logic_or(is_far, ca.logic_not(near.converged)))
        foot = Foot(self._search()(is_lost, near.state, y, guess), self._finder.lengths)
        rows = self._table(foot.theta, self.layout.order + 1)
        terms = rows[:, : partial_count(2)]
        begin = self._finder.clamped(guess)
        eta = eta + self._way(begin, foot.theta, self._terms(begin), terms)
        place = ca.vertcat(foot.theta, eta, alpha_function(2)(y, terms))
        known = ca.logic_and(foot.known, ca.fabs(ca.sum1(memory)) < math.inf)
        return self._told(ca.vertcat(place, ca.vec(rows), self._quaternion), foot, known)

    def _search(self) -> ca.Function:
        """``(is_lost, state, y, guess) -> state`` of the foot that is nearest on all the surface.

        It is the one that was found near the guess, unless another is nearer.
        """
        state, y = ca.MX.sym("state", self._finder.size), ca.MX.sym("y", 3)
        guess, grid = ca.MX.sym("guess", 2), self._global.grid
        strides = [-(-n // _MOST_SAMPLES) for n in grid.position.shape[:2]]
        part = (slice(None, None, strides[0]), slice(None, None, strides[1]))
        starts = nearest_samples(
            y, grid.theta[part].reshape(-1, 2), grid.position[part].reshape(-1, 3), self._lengths
        )
        best, found = self._finder.find(y, starts[0]), Foot(state, self._finder.lengths)
        nearer = best.rank < found.rank * (1.0 - _NOT_NEARER)
        laps = ca.floor((guess - best.theta) / self._lengths + 0.5) * self._lengths
        theta = best.theta + laps * np.array(self._closed, dtype=float)
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
