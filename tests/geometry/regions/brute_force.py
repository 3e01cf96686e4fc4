"""Distances by dense samples and another minimizer."""

import numpy as np
from scipy.optimize import minimize
from scipy.spatial import cKDTree

_STARTS = 4


class BruteForce:
    """Distance of points from a surface of the tree.

    Args:
        surface: The surface.
        count: Samples in each direction.
    """

    def __init__(self, surface, count=400):
        self._surface = surface
        first, second = (np.linspace(*ends, count) for ends in surface.domain)
        self._theta = np.stack(np.meshgrid(first, second, indexing="ij"), axis=-1).reshape(-1, 2)
        self._tree = cKDTree(surface.partials(self._theta, 0)[:, 0])

    def __call__(self, point):
        """Least distance, m, from the best of a few minimizations that stay in the domain."""
        lengths = np.array([ends.length for ends in self._surface.domain])

        def squared(scaled):
            position, first, second = self._surface.partials(scaled * lengths, 1)
            away = position - point
            return away @ away, 2.0 * lengths * [away @ first, away @ second]

        bounds = [np.array(e) / n for e, n in zip(self._surface.domain, lengths, strict=True)]
        best = self._tree.query(point)[0] ** 2
        for near in self._tree.query(point, k=_STARTS)[1]:
            result = minimize(
                squared,
                self._theta[near] / lengths,
                jac=True,
                bounds=bounds,
                method="L-BFGS-B",
                options={"ftol": 1e-16, "gtol": 1e-14},
            )
            best = min(best, result.fun)
        return np.sqrt(best)


def gradient(distance, point, step=1e-6):
    """Central differences of a signed distance, [3]."""
    moved = step * np.eye(3)
    return np.array([(distance(*(point + d))[0] - distance(*(point - d))[0]) for d in moved]) / (
        2.0 * step
    )
