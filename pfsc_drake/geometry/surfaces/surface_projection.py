"""Orthogonal projection onto a surface (4.9), and its initial guess."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import minimum_filter

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.closest_point import ClosestPointFinder
from pfsc_drake.geometry.surfaces.extended import SurfaceTable
from pfsc_drake.geometry.surfaces.parametric_surface import Surface
from pfsc_drake.geometry.surfaces.regularity import sample_grid

_MAX_STARTS = 8
# Of the domain: closest points that are nearer to each other are one.
_SAME = 1e-4
# Another sheet at less than this times the distance makes the start ambiguous.
_NEARLY_AS_NEAR = 1.1


class SurfaceProjection(NamedTuple):
    """Result of the orthogonal projection onto a surface, (4.9).

    Attributes:
        theta: Parameters of the closest point, unwrapped in closed directions.
        distance: Distance of the point from the surface, m.
        alpha: Distance over the smallest radius of curvature towards the point; it lies in the
            feasible neighbourhood if alpha < 1, which is (4.13).
        at_border: True if the point lies beyond an end of an open direction; theta is then the
            closest point of the border.
        converged: False if no strict minimum was found, also for input that is not finite.
    """

    theta: tuple[float, float]
    distance: float
    alpha: float
    at_border: bool
    converged: bool


class GlobalProjector:
    """Closest point of the whole surface (section 4.7): samples, then Newton's method.

    Args:
        surface: Surface of class C^2.

    Raises:
        InputError: The surface is not regular.
    """

    def __init__(self, surface: Surface) -> None:
        self.grid = sample_grid(surface)
        self._project = SurfaceProjector(surface).project
        self._surface = surface

    def closest_points(self, point: ArrayLike) -> list[SurfaceProjection]:
        """Return local minima of the distance, the nearest first, without convergence last.

        Args:
            point: y_t, finite, [3], m.

        Returns:
            One to eight projections, theta in the domain.
        """
        y = np.asarray(point, dtype=float)
        cost = np.sum((y - self.grid.position) ** 2, axis=-1)
        modes = ["wrap" if closed else "nearest" for closed in self.grid.closed]
        valleys = np.argwhere(cost <= minimum_filter(cost, size=3, mode=modes))
        order = np.argsort(cost[tuple(valleys.T)], kind="stable")[:_MAX_STARTS]
        values = y.tolist()
        found: list[SurfaceProjection] = []
        for start in valleys[order]:
            theta_1, theta_2 = self.grid.theta_1[start[0]], self.grid.theta_2[start[1]]
            result = self._project(values, (float(theta_1), float(theta_2)))
            wrapped = self._surface.wrap(result.theta)
            result = result._replace(theta=(float(wrapped[0]), float(wrapped[1])))
            if not any(self._same(result, other) for other in found):
                found.append(result)
        return sorted(
            found, key=lambda closest_point: (not closest_point.converged, closest_point.distance)
        )

    def project(self, point: ArrayLike) -> SurfaceProjection:
        """Return the closest point, if it is unambiguous.

        Args:
            point: y_t, [3], m.

        Returns:
            The projection, theta in the domain.

        Raises:
            InputError: The point is not three finite numbers, is equally far from many points, as
                the axis of a cylinder is, or nearly as near to another sheet.
        """
        y = np.asarray(point, dtype=float)
        if y.shape != (3,) or not np.all(np.isfinite(y)):
            raise InputError(f"point: {y.tolist()}; 3 finite numbers, in m, are required")
        where = f"point [{', '.join(f'{value:.6g}' for value in y)}] m"
        best, *others = self.closest_points(y)
        if not (best.converged and (best.alpha < 1.0 or best.at_border)):
            raise InputError(
                f"{where}: no closest point on the surface, it is {best.distance:.6g} m away, which"
                " is as far as its centre of curvature; a point nearer to the surface is required"
            )
        for other in others:
            if other.converged and other.distance < _NEARLY_AS_NEAR * best.distance:
                raise InputError(
                    f"{where}: {best.distance:.6g} m from the surface at theta ="
                    f" {_pair(best.theta)} and {other.distance:.6g} m at {_pair(other.theta)};"
                    f" must be nearer to one of both, by more than a factor of {_NEARLY_AS_NEAR:g}"
                )
        return best

    def _same(self, one: SurfaceProjection, other: SurfaceProjection) -> bool:
        for k, (begin, end) in enumerate(self._surface.domain):
            apart = abs(one.theta[k] - other.theta[k]) / (end - begin)
            if min(apart, 1.0 - apart if self._surface.closed[k] else math.inf) > _SAME:
                return False
        return True


def _pair(theta: tuple[float, float]) -> str:
    return f"[{theta[0]:.6g}, {theta[1]:.6g}]"


# Of the domain.
LONGEST_STEP = 1.0 / 16.0


class SurfaceProjector:
    """Closest point of a surface near a guess, see `ClosestPointFinder`, for numbers.

    Args:
        surface: Surface of class C^2, see `SurfaceTable` for the kinds.
    """

    def __init__(self, surface: Surface) -> None:
        table = SurfaceTable(surface)
        finder = ClosestPointFinder(
            lambda theta: table(theta, 2), surface.domain, surface.closed, LONGEST_STEP
        )
        y, guess = ca.MX.sym("y", 3), ca.MX.sym("guess", 2)
        closest_point = finder.find(y, guess)
        values = ca.vertcat(
            closest_point.theta,
            closest_point.distance,
            closest_point.alpha,
            closest_point.beyond_end,
            closest_point.converged,
        )
        function = ca.Function("project", [y, guess], [values], ["y", "guess"], ["foot"])
        self._function = BoundFunction(function)

    def project(
        self, point: Sequence[float], theta_guess: tuple[float, float]
    ) -> SurfaceProjection:
        """Return the closest point near the guess.

        Args:
            point: y_t, [3], m.
            theta_guess: Initial unwrapped parameters, usually the last result.

        Returns:
            The projection; `converged` is False, alpha NaN and nothing raised if the point or the
            guess is not finite.
        """
        function = self._function
        function.arguments["y"][:] = point
        function.arguments["guess"][:] = theta_guess
        function.evaluate()
        theta_1, theta_2, distance, alpha, at_border, converged = function.results["foot"].tolist()
        if not math.isfinite(alpha):
            return SurfaceProjection((theta_1, theta_2), math.nan, math.nan, False, False)
        return SurfaceProjection(
            (theta_1, theta_2), distance, alpha, bool(at_border), bool(converged)
        )
