"""Layout of what a surface tells the controller at each tick."""

from dataclasses import dataclass

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.partials import MAX_PARTIAL_ORDER, partial_count


@dataclass(frozen=True)
class SurfacePointLayout:
    """Where the quantities of a surface point lie in a flat array of floats.

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
    At a border of an open direction theta is clamped; the surface does not go on.

    Args:
        order: Relative degree r of the law that reads it, 1..5.
        oriented: True if the surface has an orientation of its own.

    Raises:
        InputError: order out of range.
    """

    order: int
    oriented: bool

    def __post_init__(self) -> None:
        if not isinstance(self.order, int) or not 1 <= self.order < MAX_PARTIAL_ORDER:
            raise InputError(
                f"order of surface point: {self.order};"
                f" an integer from 1 to {MAX_PARTIAL_ORDER - 1} is required"
            )

    @property
    def theta(self) -> slice:
        """Slice of theta*, [2]."""
        return slice(0, 2)

    @property
    def eta(self) -> slice:
        """Slice of the tangential coordinates, [2], m."""
        return slice(2, 4)

    @property
    def memory(self) -> slice:
        """Slice of what the next projection begins with, theta and eta, [4]."""
        return slice(0, 4)

    @property
    def alpha(self) -> slice:
        """Slice of alpha, [1]."""
        return slice(4, 5)

    @property
    def status(self) -> slice:
        """Slice of the status, [1]."""
        return slice(5, 6)

    @property
    def position(self) -> slice:
        """Slice of the partial derivatives of sigma_t, [3 count(order + 1)]."""
        return slice(6, 6 + 3 * partial_count(self.order + 1))

    @property
    def quaternion(self) -> slice:
        """Slice of the partial derivatives of q, [4 count(order)], or empty."""
        begin = self.position.stop
        return slice(begin, begin + (4 * partial_count(self.order) if self.oriented else 0))

    @property
    def size(self) -> int:
        """Length of the whole array."""
        return self.quaternion.stop
