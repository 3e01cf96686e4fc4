"""What a surface tells the controller at each tick; the frame and the target there."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.curvature import fundamental_forms
from pfsc_drake.geometry.surfaces.surface import MAX_PARTIAL_ORDER, Surface, partial_count


def surface_axes(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return ``[t_1, e_perp x t_1, e_perp]`` as columns, (4.2), (4.3).

    Sigma of (4.15) holds the components of both slopes along the first two.

    Args:
        first: ``sigma_1``, in world axes, [3].
        second: ``sigma_2``, [3].

    Returns:
        Rotation matrix [3, 3]; not finite where the surface is not regular.
    """
    cross = np.cross(first, second)
    with np.errstate(invalid="ignore", divide="ignore"):
        t_1, normal = first / np.linalg.norm(first), cross / np.linalg.norm(cross)
    return np.column_stack([t_1, np.cross(normal, t_1), normal])


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


class SurfaceTarget:
    """The point ``p = sigma(theta) + xi e_perp(theta)``, and its velocity.

    ``p' = (sigma_1 + xi e_perp,1) theta_1' + (sigma_2 + xi e_perp,2) theta_2' + xi' e_perp`` with
    the Weingarten equations (4.6).

    Args:
        surface: The surface. Beyond the ends of open directions theta is clamped.
    """

    def __init__(self, surface: Surface) -> None:
        self._surface = surface

    def __call__(self, coordinates: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return p [m] and p' [m/s], world axes, shape (3,) each.

        Args:
            coordinates: ``(theta_1, theta_2, xi)``, shape (3,), xi in m.
            rates: Their derivatives, shape (3,).
        """
        theta, xi = np.array(coordinates[:2], dtype=float), float(coordinates[2])
        for k, (ends, closed) in enumerate(
            zip(self._surface.domain, self._surface.closed, strict=True)
        ):
            if not closed:
                theta[k] = min(max(theta[k], ends.begin), ends.end)
        sigma, *tangents = self._surface.partials(theta, 1)
        forms = fundamental_forms(self._surface, theta)
        S = np.array(tangents)
        turning = forms.weingarten @ S
        p_rate = (S + xi * turning).T @ rates[:2] + rates[2] * forms.normal
        return sigma + xi * forms.normal, p_rate
