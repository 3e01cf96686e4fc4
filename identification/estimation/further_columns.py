"""Further columns of a linear system, and their products with those that it has."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from identification.estimation.friction import FrictionTerm
from identification.estimation.information import Information

_REMEMBERED = 128  # terms with their products


class Products(NamedTuple):
    """What a further column adds to the normal equations.

    Attributes:
        column: Of one joint, weighted, shape (K,).
        columns: Its products with the columns of the system, shape (n_b,).
        torques: Its product with the torques.
    """

    column: np.ndarray
    columns: np.ndarray
    torques: float


class FurtherColumns:
    """A weighted linear system that terms of friction may be added to; K instants, N joints.

    Attributes:
        X: Weighted information matrix, shape (K N, n_b).
        b: Weighted torques, shape (K N,).
        by_joint: X, shape (K, N, n_b).
        torques: b, shape (K, N).
        v: Velocities of the joints [rad/s or m/s], shape (K, N).
        names: Of the n_b parameters.
    """

    def __init__(self, system: Information, v: np.ndarray) -> None:
        """Weights a system.

        Args:
            system: The linear system.
            v: Velocities of its joints [rad/s or m/s], shape (K, N).
        """
        shape = system.torques.shape
        self.X, self.b = system.weighted()
        self.by_joint = self.X.reshape(*shape, -1)
        self.torques = self.b.reshape(shape)
        self.v, self.names = np.asarray(v), system.base.short_names
        self._weights = system.weights
        self.products = lru_cache(maxsize=_REMEMBERED)(self._products)

    def column(self, term: FrictionTerm) -> np.ndarray:
        """Return the weighted column of a term in its joint, shape (K,)."""
        column: np.ndarray = term.column(self.v[:, term.joint]) * self._weights[:, term.joint]
        return column

    def _products(self, term: FrictionTerm) -> Products:
        column, joint = self.column(term), term.joint
        return Products(
            column, self.by_joint[:, joint].T @ column, float(self.torques[:, joint] @ column)
        )
