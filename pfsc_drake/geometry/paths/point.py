"""Layout of what a path tells the controller at each tick."""

from dataclasses import dataclass

from pfsc_drake.errors import InputError

_MAX_ORDER = 5


@dataclass(frozen=True)
class PathPointLayout:
    """Where the quantities of a path point lie in a flat array of floats.

    | field        | length          | meaning                                              |
    |--------------|-----------------|------------------------------------------------------|
    | `theta`      | 1               | parameter of the closest point (3.6), unwrapped      |
    | `eta`        | 1               | arc length (3.12), m                                 |
    | `alpha`      | 1               | (3.9); below one in the feasible neighbourhood       |
    | `status`     | 1               | a `ProjectionStatus`                                       |
    | `normal`     | 3               | e_perp, (3.4)                                        |
    | `position`   | 3 (order + 2)   | derivatives 0..order + 1 of sigma_t, row-major, m    |
    | `quaternion` | 4 (order + 1)   | derivatives 0..order of q; empty if not oriented     |
    | `turn`       | order           | derivatives 1..order of psi, rad; empty if not turning |

    Derivatives are with respect to theta, the index of the derivative is the slow one.
    Beyond an end of an open path it goes on smoothly to a straight line and a constant
    orientation, see `paths.run_out`. Beyond that theta is clamped: derivatives of sigma_t from
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

    order: int
    oriented: bool
    turning: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.order, int) or not 1 <= self.order <= _MAX_ORDER:
            raise InputError(
                f"order of path point: {self.order}; an integer from 1 to {_MAX_ORDER} is required"
            )

    @property
    def theta(self) -> slice:
        """Slice of theta*, [1]."""
        return slice(0, 1)

    @property
    def memory(self) -> slice:
        """Slice of what the next projection begins with, theta*, [1]."""
        return self.theta

    @property
    def eta(self) -> slice:
        """Slice of the arc length, [1], m."""
        return slice(1, 2)

    @property
    def alpha(self) -> slice:
        """Slice of alpha, [1]."""
        return slice(2, 3)

    @property
    def status(self) -> slice:
        """Slice of the status, [1]."""
        return slice(3, 4)

    @property
    def normal(self) -> slice:
        """Slice of e_perp, [3]."""
        return slice(4, 7)

    @property
    def position(self) -> slice:
        """Slice of the derivatives of sigma_t, [3 (order + 2)]."""
        return slice(7, 7 + 3 * (self.order + 2))

    @property
    def quaternion(self) -> slice:
        """Slice of the derivatives of q, [4 (order + 1)], or empty."""
        begin = self.position.stop
        return slice(begin, begin + (4 * (self.order + 1) if self.oriented else 0))

    @property
    def turn(self) -> slice:
        """Slice of the derivatives of psi, [order], or empty."""
        begin = self.quaternion.stop
        return slice(begin, begin + (self.order if self.turning else 0))

    @property
    def size(self) -> int:
        """Length of the whole array."""
        return self.turn.stop
