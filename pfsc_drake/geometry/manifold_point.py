"""Points of paths and surfaces: their layout in an array, and their evaluation next to a tool."""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Generic, Literal, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.closest_point import ClosestPoint, Ends, first_and_bend, largest_eigenvalue
from pfsc_drake.geometry.nearest_samples import ProjectionStatus
from pfsc_drake.geometry.surfaces.parametric_surface import partial_count

_MAX_ORDER = 5


@dataclass(frozen=True)
class PointLayout(ABC):
    """Layout of a point of one or two parameters in a flat array of floats.

    Fields stand in the order of the tables below. Derivatives are with respect to theta, the index
    of the derivative is the slow one.

    Args:
        order: Relative degree r of the law that reads it, 1..5.
        oriented: True if there is an orientation of its own.

    Attributes:
        size: Length of the whole array.

    Raises:
        InputError: order out of range.
    """

    order: int
    oriented: bool

    theta: slice = field(init=False, repr=False, compare=False)
    eta: slice = field(init=False, repr=False, compare=False)
    alpha: slice = field(init=False, repr=False, compare=False)
    status: slice = field(init=False, repr=False, compare=False)
    position: slice = field(init=False, repr=False, compare=False)
    quaternion: slice = field(init=False, repr=False, compare=False)
    size: int = field(init=False, repr=False, compare=False)

    kind: ClassVar[str]

    def __post_init__(self) -> None:
        if not isinstance(self.order, int) or not 1 <= self.order <= _MAX_ORDER:
            raise InputError(
                f"order of {self.kind} point: {self.order};"
                f" an integer from 1 to {_MAX_ORDER} is required"
            )
        end = 0
        for name, length in self._lengths().items():
            begin, end = end, end + length
            object.__setattr__(self, name, slice(begin, end))
        object.__setattr__(self, "size", end)

    @property
    @abstractmethod
    def memory(self) -> slice:
        """Slice of the initial values of the next projection."""

    @abstractmethod
    def _lengths(self) -> dict[str, int]:
        """Return lengths of all fields, in their order."""


@dataclass(frozen=True)
class PathPointLayout(PointLayout):
    """Layout of a path's point.

    | field        | length          | meaning                                                |
    |--------------|-----------------|--------------------------------------------------------|
    | `theta`      | 1               | parameter of the closest point (3.6), unwrapped        |
    | `eta`        | 1               | arc length (3.12), m                                   |
    | `alpha`      | 1               | (3.9); below one in the feasible neighbourhood         |
    | `status`     | 1               | a `ProjectionStatus`                                   |
    | `normal`     | 3               | e_perp, (3.4)                                          |
    | `position`   | 3 (order + 2)   | derivatives 0..order + 1 of sigma_t, row-major, m      |
    | `quaternion` | 4 (order + 1)   | derivatives 0..order of q; empty if not oriented       |
    | `turn`       | order           | derivatives 1..order of psi, rad; empty if not turning |

    Beyond an end of an open path it is continued smoothly to a straight line and a constant
    orientation, see `paths.table`. Beyond that theta is clamped: derivatives of sigma_t from
    the second, of q from the first and of psi, and alpha, are zero, e_perp is constant, and
    eta = s(theta) + e_par . (y - sigma_t(theta)).

    psi is the angle about e_par by which a prescribed e_perp turns against one transported in
    parallel: psi' = (e_par x e_perp) . e_perp'.

    Args:
        order: Relative degree r of the law that reads it, 1..5.
        oriented: True if the path has an orientation.
        turning: True if e_perp is prescribed, such as by a surface, rather than transported.

    Raises:
        InputError: order out of range.
    """

    turning: bool = False

    normal: slice = field(init=False, repr=False, compare=False)
    turn: slice = field(init=False, repr=False, compare=False)

    kind: ClassVar[str] = "path"

    @property
    def memory(self) -> slice:
        """Slice of the initial value of the next projection, theta*, [1]."""
        return self.theta

    def _lengths(self) -> dict[str, int]:
        r = self.order
        lengths = {"theta": 1, "eta": 1, "alpha": 1, "status": 1, "normal": 3}
        lengths |= {"position": 3 * (r + 2), "quaternion": 4 * (r + 1) * self.oriented}
        return lengths | {"turn": r * self.turning}


@dataclass(frozen=True)
class SurfacePointLayout(PointLayout):
    """Layout of a surface's point.

    | field        | length              | meaning                                                 |
    |--------------|---------------------|---------------------------------------------------------|
    | `theta`      | 2                   | parameters of the closest point (4.9), unwrapped        |
    | `eta`        | 2                   | (4.15), m                                               |
    | `alpha`      | 1                   | below one in the feasible neighbourhood (4.11)-(4.13)   |
    | `status`     | 1                   | a `ProjectionStatus`                                    |
    | `position`   | 3 count(order + 1)  | partial derivatives of sigma_t up to order + 1, m       |
    | `quaternion` | 4 count(order)      | the same of q up to order; empty if not oriented        |

    Rows of partial derivatives stand as in `partials`, with count(n) = (n + 1) (n + 2) / 2 of them.
    alpha is the largest of (d . sigma_uu) / (sigma_u . sigma_u) over all directions u of the
    parameters, d = y_t - sigma_t: the distance over the smallest radius of curvature towards
    the tool, so that H > 0 if and only if alpha < 1.
    Beyond a border of an open direction the surface is extended, see `surfaces.extended`.

    Args:
        order: Relative degree r of the law that reads it, 1..5.
        oriented: True if the surface has an orientation of its own.

    Raises:
        InputError: order out of range.
    """

    kind: ClassVar[str] = "surface"

    @property
    def memory(self) -> slice:
        """Slice of the initial values of the next projection, theta and eta, [4]."""
        return slice(0, self.eta.stop)

    def _lengths(self) -> dict[str, int]:
        position, quaternion = (partial_count(n) for n in (self.order + 1, self.order))
        lengths = {"theta": 2, "eta": 2, "alpha": 1, "status": 1, "position": 3 * position}
        return lengths | {"quaternion": 4 * quaternion * self.oriented}


Layout = TypeVar("Layout", bound=PointLayout)


class ManifoldEvaluator(ABC, Generic[Layout]):
    """Projection of a point, and all quantities there that a law of one order needs.

    There is no memory: the same input gives the same output. Calling the object evaluates
    ``evaluate``.

    Args:
        layout: Layout of the manifold's point.
        domain: First and last value of each parameter.
        closed: Whether each parameter is periodic.
        *sources: All objects that the functions depend on.

    Attributes:
        layout: Layout of the manifold's point.
    """

    def __init__(
        self, layout: Layout, domain: Sequence[Ends], closed: Sequence[bool], *sources: object
    ) -> None:
        self.layout, self._sources = layout, sources
        self._domain, self._closed = domain, closed

    def __content__(self) -> object:
        """Return all objects that the functions depend on."""
        return self._sources

    @cached_property
    def evaluate(self) -> ca.Function:
        """``(y_t, memory) -> manifold_point``, the manifold next to a point [m], shape (3,).

        Memory is the part `PointLayout.memory` of the last tick's point. All values but
        ``status`` are NaN if either is not finite.
        """
        return self._function("point")

    @cached_property
    def at(self) -> ca.Function:
        """``memory -> manifold_point``, the manifold at its parameters, with alpha zero."""
        return self._function("at")

    @cached_property
    def find(self) -> ca.Function:
        """``y_t -> memory``, the closest point of the whole manifold, in the first period."""
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
    def _at_closest(self, y: ca.MX, memory: ca.MX) -> ca.MX:
        """Return the manifold's point at the closest point to y."""

    @abstractmethod
    def _on(self, memory: ca.MX) -> ca.MX:
        """Return the manifold's point at its parameters, with alpha zero and status OK."""

    @abstractmethod
    def _nearest(self, y: ca.MX) -> ca.MX:
        """Return the memory of the closest point of the whole manifold."""

    @once_per_content()
    def _function(self, what: Literal["point", "at", "place"]) -> ca.Function:
        memory = self.layout.memory
        y, last = ca.MX.sym("y_t", 3), ca.MX.sym("memory", memory.stop - memory.start)
        name, result = f"{self.layout.kind}_{what}", ["manifold_point"]
        if what == "point":
            results = [self._at_closest(y, last)]
            return ca.Function(name, [y, last], results, ["y_t", "memory"], result)
        if what == "at":
            return ca.Function(name, [last], [self._on(last)], ["memory"], result)
        return ca.Function(name, [y], [self._nearest(y)], ["y_t"], ["memory"])

    @cached_property
    def _bound_evaluate(self) -> BoundFunction:
        return BoundFunction(self.evaluate)

    def _with_status(self, values: ca.MX, closest_point: ClosestPoint, known: ca.MX) -> ca.MX:
        """Return the manifold's point from all its values but the status."""
        beyond = closest_point.beyond_end
        for k, (begin, end) in enumerate(self._domain):
            if not self._closed[k]:
                outside = ca.logic_or(closest_point.theta[k] < begin, closest_point.theta[k] > end)
                beyond = ca.logic_or(beyond, outside)
        status = ca.if_else(
            ca.logic_and(known, closest_point.converged),
            ca.if_else(beyond, float(ProjectionStatus.BEYOND_END), float(ProjectionStatus.OK)),
            float(ProjectionStatus.NOT_CONVERGED),
        )
        # NaN or infinite inputs have no closest point
        values = ca.if_else(known, values, math.nan)
        index = self.layout.status.start
        return ca.vertcat(values[:index], status, values[index:])


def alpha_function(p: int) -> ca.Function:
    """Return ``(y, terms) -> alpha`` (3.9), (4.13), see `ClosestPoint.alpha`.

    Args:
        p: Number of parameters.
    """
    y, terms = ca.SX.sym("y", 3), ca.SX.sym("terms", 3, (p + 1) * (p + 2) // 2)
    alpha = largest_eigenvalue(*first_and_bend(y, terms, p))
    return ca.Function("alpha", [y, terms], [alpha], {"cse": True})
