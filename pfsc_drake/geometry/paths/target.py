"""Points beside a path that move with given path coordinates."""

import numpy as np

from pfsc_drake.geometry import Path
from pfsc_drake.geometry.paths.frame import manifold_axes


class PathTarget:
    """The point with path coordinates ``(eta, xi_1, xi_2)``, and its velocity.

    ``p = sigma + xi_1 e_perp + xi_2 e_cross`` at the arc length eta; with the curvature vector
    ``k = d e_par / d eta`` and a parallel transport frame, which does not spin about the path::

        p' = e_par eta' (1 - xi_1 k . e_perp - xi_2 k . e_cross) + xi_1' e_perp + xi_2' e_cross

    A given frame, which turns by ``w = d psi / d eta``, adds
    ``w eta' (xi_1 e_cross - xi_2 e_perp)``.

    Args:
        path: The path. Beyond the ends of an open path eta is clamped.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._evaluator = path, path.evaluator(1)
        self._layout = self._evaluator.layout

    def __call__(self, coordinates: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return p [m] and p' [m/s], world axes, shape (3,) each.

        Args:
            coordinates: ``(eta, xi_1, xi_2)`` [m], shape (3,).
            rates: Their derivatives [m/s], shape (3,).
        """
        eta, xi = float(coordinates[0]), coordinates[1:]
        if not self._path.closed:
            eta = min(max(eta, 0.0), self._path.length)
        point = self._evaluator.evaluate_at(self._path.arc_length.parameter(eta))
        sigma, slope, bend = point[self._layout.position].reshape(-1, 3)
        axes = manifold_axes(slope, point[self._layout.normal])
        e_par, normals = axes[:, 0], axes[:, 1:]
        curvature = (bend - e_par * (e_par @ bend)) / (slope @ slope)
        along = rates[0] * (1.0 - xi @ (normals.T @ curvature))
        across = rates[1:]
        if self._layout.turning:
            spin = point[self._layout.turn][0] / np.linalg.norm(slope)
            across = across + rates[0] * spin * np.array([-xi[1], xi[0]])
        return sigma + normals @ xi, along * e_par + normals @ across
