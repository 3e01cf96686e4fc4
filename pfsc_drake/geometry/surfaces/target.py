"""Points beside a surface that move with given coordinates."""

import numpy as np

from pfsc_drake.geometry.surfaces.curvature import fundamental_forms
from pfsc_drake.geometry.surfaces.surface import Surface


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
