"""Layouts of what a path or a surface tells the controller at each tick."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.surface import partial_count

_MAX_ORDER = 5


@dataclass(frozen=True)
class PointLayout(ABC):
    """Where the quantities of a point of one or two parameters lie in a flat array of floats.

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
        """Slice of what the next projection begins with."""

    @abstractmethod
    def _lengths(self) -> dict[str, int]:
        """Lengths of all fields, in their order."""


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

    Beyond an end of an open path it goes on smoothly to a straight line and a constant
    orientation, see `paths.table`. Beyond that theta is clamped: derivatives of sigma_t from
    the second, of q from the first and of psi, and alpha, are zero, e_perp is kept, and
    eta = s(theta) + e_par . (y - sigma_t(theta)).

    psi is the angle about e_par by which a given e_perp turns against one that is transported in
    parallel: psi' = (e_par x e_perp) . e_perp'.

    Args:
        order: Relative degree r of the law that reads it, 1..5.
        oriented: True if the path has an orientation.
        turning: True if e_perp is given, such as by a surface, rather than transported.

    Raises:
        InputError: order out of range.
    """

    turning: bool = False

    normal: slice = field(init=False, repr=False, compare=False)
    turn: slice = field(init=False, repr=False, compare=False)

    kind: ClassVar[str] = "path"

    @property
    def memory(self) -> slice:
        """Slice of what the next projection begins with, theta*, [1]."""
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
    Beyond a border of an open direction the surface goes on, see `surfaces.extended`.

    Args:
        order: Relative degree r of the law that reads it, 1..5.
        oriented: True if the surface has an orientation of its own.

    Raises:
        InputError: order out of range.
    """

    kind: ClassVar[str] = "surface"

    @property
    def memory(self) -> slice:
        """Slice of what the next projection begins with, theta and eta, [4]."""
        return slice(0, self.eta.stop)

    def _lengths(self) -> dict[str, int]:
        position, quaternion = (partial_count(n) for n in (self.order + 1, self.order))
        lengths = {"theta": 2, "eta": 2, "alpha": 1, "status": 1, "position": 3 * position}
        return lengths | {"quaternion": 4 * quaternion * self.oriented}
