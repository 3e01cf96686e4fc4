"""What a path or a surface tells the controller at each tick, as functions of a point in space."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property
from typing import Generic, Literal, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.geometry.foot import Ends, Foot, first_and_bend, largest_eigenvalue
from pfsc_drake.geometry.nearest import ProjectionStatus
from pfsc_drake.geometry.point import PointLayout

Layout = TypeVar("Layout", bound=PointLayout)


class ManifoldEvaluator(ABC, Generic[Layout]):
    """Projects a point and evaluates everything a law of one order needs there.

    There is no memory: the same input gives the same output. Calling the object evaluates
    ``evaluate``.

    Args:
        layout: Where the quantities lie in the manifold's point.
        domain: First and last value of each parameter.
        closed: For each parameter whether it is periodic.
        *made_of: What decides over it.

    Attributes:
        layout: Where the quantities lie in the manifold's point.
    """

    def __init__(
        self, layout: Layout, domain: Sequence[Ends], closed: Sequence[bool], *made_of: object
    ) -> None:
        self.layout, self._made_of = layout, made_of
        self._domain, self._closed = domain, closed

    def __content__(self) -> object:
        """Return what decides over it."""
        return self._made_of

    @cached_property
    def evaluate(self) -> ca.Function:
        """``(y_t, memory) -> manifold_point``, the manifold next to a point [m], shape (3,).

        Memory is what of the last tick's point `PointLayout.memory` says. All values but
        ``status`` are NaN if either is not finite.
        """
        return self._function("point")

    @cached_property
    def at(self) -> ca.Function:
        """``memory -> manifold_point``, the manifold at its parameters, with alpha zero."""
        return self._function("at")

    @cached_property
    def find(self) -> ca.Function:
        """``y_t -> memory``, the nearest place of the whole manifold, on the first lap."""
        return self._function("place")

    def __call__(self, point: ArrayLike, *memory: ArrayLike) -> np.ndarray:
        """Return the manifold's point next to a point, new array [layout.size].

        Args:
            point: y_t, [3], m.
            memory: Unwrapped parameters of the last tick; for a surface also the tangential
                coordinates there, [2], m.
        """
        function = self._bound_evaluate
        function.arguments["y_t"][:] = point
        function.arguments["memory"][:] = np.hstack(memory)
        function.evaluate()
        return function.results["manifold_point"].copy()

    @abstractmethod
    def _at_foot(self, y: ca.MX, memory: ca.MX) -> ca.MX:
        """Manifold's point at the foot of a point."""

    @abstractmethod
    def _on(self, memory: ca.MX) -> ca.MX:
        """Manifold's point at a place on the manifold, with alpha zero and status OK."""

    @abstractmethod
    def _nearest(self, y: ca.MX) -> ca.MX:
        """Memory of the nearest place of all."""

    @once_per_content()
    def _function(self, what: Literal["point", "at", "place"]) -> ca.Function:
        memory = self.layout.memory
        y, place = ca.MX.sym("y_t", 3), ca.MX.sym("memory", memory.stop - memory.start)
        name, result = f"{self.layout.kind}_{what}", ["manifold_point"]
        if what == "point":
            told = [self._at_foot(y, place)]
            return ca.Function(name, [y, place], told, ["y_t", "memory"], result)
        if what == "at":
            return ca.Function(name, [place], [self._on(place)], ["memory"], result)
        return ca.Function(name, [y], [self._nearest(y)], ["y_t"], ["memory"])

    @cached_property
    def _bound_evaluate(self) -> BoundFunction:
        return BoundFunction(self.evaluate)

    def _told(self, values: ca.MX, foot: Foot, known: ca.MX) -> ca.MX:
        """Manifold's point of all values but the status."""
        beyond = foot.beyond_end
        for k, (begin, end) in enumerate(self._domain):
            if not self._closed[k]:
                outside = ca.logic_or(foot.theta[k] < begin, foot.theta[k] > end)
                beyond = ca.logic_or(beyond, outside)
        status = ca.if_else(
            ca.logic_and(known, foot.converged),
            ca.if_else(beyond, float(ProjectionStatus.BEYOND_END), float(ProjectionStatus.OK)),
            float(ProjectionStatus.NOT_CONVERGED),
        )
        # what is not finite has no foot
        values = ca.if_else(known, values, math.nan)
        place = self.layout.status.start
        return ca.vertcat(values[:place], status, values[place:])


def alpha_function(p: int) -> ca.Function:
    """Return ``(y, terms) -> alpha`` (3.9), (4.13), see `Foot.alpha`.

    Args:
        p: Number of parameters.
    """
    y, terms = ca.SX.sym("y", 3), ca.SX.sym("terms", 3, (p + 1) * (p + 2) // 2)
    alpha = largest_eigenvalue(*first_and_bend(y, terms, p))
    return ca.Function("alpha", [y, terms], [alpha], {"cse": True})
