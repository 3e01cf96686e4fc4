"""Frames, fundamental forms and curvatures of surfaces (section 4.3), and a point beside one."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.geometry.surfaces.parametric_surface import Surface


@dataclass(frozen=True)
class FundamentalForms:
    """First and second fundamental form at points of a surface, shapes [...].

    Attributes:
        normal: e_perp, (4.3) with the square root of E G - F^2, [..., 3].
        E: First coefficient of the first form (4.5), m^2.
        F: Its mixed coefficient, m^2.
        G: Its last coefficient, m^2.
        L: First coefficient of the second form (4.8), m.
        M: Its mixed coefficient, m.
        N: Its last coefficient, m.
    """

    normal: np.ndarray
    E: np.ndarray
    F: np.ndarray
    G: np.ndarray
    L: np.ndarray
    M: np.ndarray
    N: np.ndarray

    @property
    def weingarten(self) -> np.ndarray:
        """Matrix alpha of (4.6), (4.7), [..., 2, 2]: row i is the derivative of e_perp."""
        E, F, G, L, M, N = self.E, self.F, self.G, self.L, self.M, self.N
        rows = np.array([[M * F - L * G, L * F - M * E], [N * F - M * G, M * F - N * E]])
        return np.asarray(np.moveaxis(rows, (0, 1), (-2, -1)) / self.determinant[..., None, None])

    @property
    def determinant(self) -> np.ndarray:
        """E G - F^2, (4.4), m^4."""
        return np.asarray(self.E * self.G - self.F**2)

    @property
    def principal_curvatures(self) -> tuple[np.ndarray, np.ndarray]:
        """Largest and smallest curvature, 1/m; positive where the surface bends to e_perp."""
        mean, spread = mean_and_spread(self.E, self.F, self.G, self.L, self.M, self.N)
        return mean + spread, mean - spread


def fundamental_forms(surface: Surface, theta: ArrayLike) -> FundamentalForms:
    """Return the fundamental forms of a surface of class C^2.

    Args:
        surface: The surface.
        theta: Parameters, [..., 2].
    """
    _, first, second, *bends = np.moveaxis(surface.partials(theta, 2), -2, 0)
    cross = np.cross(first, second)
    normal = cross / np.linalg.norm(cross, axis=-1, keepdims=True)
    products = [(first, first), (first, second), (second, second)]
    products += [(bend, normal) for bend in bends]
    return FundamentalForms(normal, *(np.sum(a * b, axis=-1) for a, b in products))


def mean_and_spread(
    E: np.ndarray, F: np.ndarray, G: np.ndarray, L: np.ndarray, M: np.ndarray, N: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and half difference of the eigenvalues of a form L, M, N relative to E, F, G.

    Written in an orthonormal basis of the tangent plane, so that the difference is exact at
    umbilics, too.

    Args:
        E: First coefficient of the first form, [...].
        F: Its mixed coefficient, [...].
        G: Its last coefficient, [...].
        L: First coefficient of the second form, [...].
        M: Its mixed coefficient, [...].
        N: Its last coefficient, [...].

    Returns:
        Both [...]; the second is not negative.
    """
    determinant = E * G - F * F
    along = L / E
    mixed = (M - F * along) / np.sqrt(determinant)
    across = (N * E - 2.0 * F * M + F * F * along) / determinant
    return 0.5 * (along + across), np.hypot(0.5 * (along - across), mixed)


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
