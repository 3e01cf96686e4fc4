"""Modes of a linear sampled loop ``x_{k+1} = A x_k`` as rates and damping ratios."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

# 1/s; what grows or decays by less is neutral: numbers that nothing calls back
NEUTRAL = 0.1
_SMALLEST = 1e-300


@dataclass(frozen=True)
class Modes:
    """Modes of a sampled loop, the slowest first.

    Attributes:
        rate: ``log|lambda| / T_s`` [1/s], shape (k,); positive grows.
        frequency: ``|arg lambda| / T_s`` [rad/s], shape (k,).
        neutral: Number of modes that neither grow nor decay; they are not among the others.
    """

    rate: np.ndarray
    frequency: np.ndarray
    neutral: int

    @property
    def damping(self) -> np.ndarray:
        """Damping ratios ``-rate / |log lambda / T_s|``, shape (k,)."""
        return -self.rate / np.hypot(self.rate, self.frequency)

    @property
    def slowest(self) -> float:
        """Rate of the slowest or of the fastest growing mode [1/s]; -inf without modes."""
        return float(self.rate[0]) if len(self.rate) else -np.inf

    @property
    def slowest_frequency(self) -> float:
        """Frequency of that mode [rad/s]."""
        return float(self.frequency[0]) if len(self.rate) else 0.0

    @property
    def smallest_damping(self) -> float:
        """The smallest damping ratio; 1 without modes."""
        return float(np.min(self.damping, initial=1.0))

    @property
    def is_stable(self) -> bool:
        """Whether nothing grows."""
        return self.slowest <= 0.0


def modes(A: np.ndarray, period: float) -> Modes:
    """Return the modes of a sampled loop.

    Args:
        A: Map of one sampling interval, shape (n, n).
        period: Sampling time ``T_s`` [s].
    """
    eigenvalues = np.linalg.eigvals(A)
    rate = np.log(np.maximum(np.abs(eigenvalues), _SMALLEST)) / period
    frequency = np.abs(np.angle(eigenvalues)) / period
    counts = np.abs(rate) > NEUTRAL
    order = np.argsort(-rate[counts], kind="stable")
    return Modes(rate[counts][order], frequency[counts][order], int(np.sum(~counts)))


def in_loop(changes: np.ndarray, core: np.ndarray) -> np.ndarray:
    """Return which variables are in a loop with others: what they do comes back to them.

    Counters, memories that are overwritten, integrals without gain and disturbances are not;
    without them the others behave the same.

    Args:
        changes: Whether the variable in the column changes that in the row, shape (n, n).
        core: Whether a variable is of the controlled system itself, shape (n,).

    Returns:
        Shape (n,): whether a variable is changed by the core and changes it, at however many
        removes; those of the core included.
    """
    reached = _reached(changes, core)
    reaching = _reached(changes.T, core)
    return core | (reached & reaching)


def _reached(changes: np.ndarray, core: np.ndarray) -> np.ndarray:
    """Return what is changed by the core, at however many removes, and the core."""
    n = len(core)
    # one more node that changes all of the core
    graph = np.zeros((n + 1, n + 1), dtype=bool)
    graph[:n, :n], graph[n, :n] = changes.T, core
    found = breadth_first_order(csr_array(graph), n, return_predecessors=False)
    reached = np.zeros(n + 1, dtype=bool)
    reached[found] = True
    return reached[:n]
