"""Closest point on a surface."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.geometry.foot import FootFinder
from pfsc_drake.geometry.surfaces.surface import Surface
from pfsc_drake.geometry.surfaces.surface_table import SurfaceTable

# Of the domain.
LONGEST_STEP = 1.0 / 16.0

Pair = tuple[float, float]


class SurfaceProjection(NamedTuple):
    """Result of the orthogonal projection onto a surface, (4.9).

    Attributes:
        theta: Parameters of the closest point, unwrapped in closed directions.
        distance: Of the point from there, m.
        alpha: Distance over the smallest radius of curvature towards the point; it lies in the
            feasible neighbourhood if alpha < 1, which is (4.13).
        at_border: True if the point lies beyond an end of an open direction; theta is then the
            closest point of the border.
        converged: False if no strict minimum was found, also for input that is not finite.
    """

    theta: Pair
    distance: float
    alpha: float
    at_border: bool
    converged: bool


class SurfaceProjector:
    """Closest point of a surface near a guess, see `FootFinder`, for numbers.

    Args:
        surface: Surface of class C^2, see `SurfaceTable` for the kinds.
    """

    def __init__(self, surface: Surface) -> None:
        table = SurfaceTable(surface)
        finder = FootFinder(
            lambda theta: table(theta, 2), surface.domain, surface.closed, LONGEST_STEP
        )
        y, guess = ca.MX.sym("y", 3), ca.MX.sym("guess", 2)
        foot = finder.find(y, guess)
        values = ca.vertcat(foot.theta, foot.distance, foot.alpha, foot.beyond_end, foot.converged)
        function = ca.Function("project", [y, guess], [values], ["y", "guess"], ["foot"])
        self._function = BoundFunction(function)

    def project(self, point: Sequence[float], theta_guess: Pair) -> SurfaceProjection:
        """Closest point near the guess.

        Args:
            point: y_t, [3], m.
            theta_guess: Unwrapped parameters to start from, as a rule the last result.

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
