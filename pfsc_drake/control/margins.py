"""Margins of a sampled linear loop: its modes, disc margins of the drives, and delay."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import scipy.linalg
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


_POINTS = 400  # frequencies that are looked at first
_SLOWEST = 0.01  # rad/s; neutral modes are at 0
_REFINEMENTS, _FINER = 3, 20
_BALANCING = 30  # sweeps at most
_BALANCED = 1e-3


@dataclass(frozen=True)
class DiscMargin:
    """What gain and phase errors a loop bears.

    Attributes:
        alpha: Disc margin, 0 (none) to 2 (any gain).
        frequency: Where the loop is weakest [rad/s].
    """

    alpha: float
    frequency: float

    @property
    def gain(self) -> tuple[float, float]:
        """Least and largest factor of the gain that are borne."""
        if self.alpha >= 2.0:
            return 0.0, np.inf
        return (2.0 - self.alpha) / (2.0 + self.alpha), (2.0 + self.alpha) / (2.0 - self.alpha)

    @property
    def phase(self) -> float:
        """Phase error that is borne [rad]."""
        return 2.0 * float(np.arctan(self.alpha / 2.0))


NO_MARGIN = DiscMargin(0.0, 0.0)


class BrokenLoop:
    """``S - T`` of a loop broken at its holds.

    With the Schur form ``A = Q R Q^H`` every frequency takes a triangular system only.

    Args:
        A: Map of one sampling interval, shape (n, n).
        holds: Index of each drive's held command, shape (N,).
        period: Sampling time [s].

    Attributes:
        num_drives: N.
        is_stable: Whether nothing grows.
        frequencies: A grid, and all resonances [rad/s].
    """

    def __init__(self, A: np.ndarray, holds: np.ndarray, period: float) -> None:
        self.num_drives, self.is_stable = len(holds), modes(A, period).is_stable
        R, Q = scipy.linalg.schur(A, output="complex")
        self._period, self._eigenvalues, self._negative = period, np.diag(R).copy(), -R
        self._into, self._out = Q.conj().T @ A[:, holds], Q[holds]
        angles = np.abs(np.angle(self._eigenvalues)) / period
        nyquist = np.pi / period
        grid = np.geomspace(min(_SLOWEST, 0.01 * nyquist), nyquist, _POINTS)
        resonances = angles[(angles > grid[0]) & (angles < nyquist)]
        self.frequencies = np.unique(np.concatenate([grid, resonances]))

    @cached_property
    def values(self) -> np.ndarray:
        """``S - T`` at all ``frequencies``, shape (frequencies, N, N)."""
        return self(self.frequencies)

    def __call__(self, frequencies: np.ndarray) -> np.ndarray:
        """Return ``S - T`` at frequencies [rad/s], shape (frequencies, N, N)."""
        N, resolvent = self.num_drives, self._negative.copy()
        answers = np.empty((len(frequencies), N, N), dtype=complex)
        for answer, z in zip(answers, np.exp(1j * frequencies * self._period), strict=True):
            np.fill_diagonal(resolvent, z - self._eigenvalues)
            inside = scipy.linalg.solve_triangular(resolvent, self._into, check_finite=False)
            answer[:] = self._out @ inside  # -T
        return np.eye(N) + 2.0 * answers


def disc_margins(loop: BrokenLoop) -> list[DiscMargin]:
    """Return the disc margin of every drive, the others being as they are.

    Args:
        loop: The loop, N drives.

    Returns:
        No margins if the loop is unstable.
    """
    if not loop.is_stable:
        return [NO_MARGIN] * loop.num_drives
    return [_margin(loop, partial(_of_drive, i)) for i in range(loop.num_drives)]


def common_disc_margin(loop: BrokenLoop) -> DiscMargin:
    """Return a disc margin for all drives at once, each with an error of its own.

    The structured singular value is bounded by scaling the drives, so that the loop bears at
    least what is returned.

    Args:
        loop: The loop.

    Returns:
        No margin if the loop is unstable.
    """
    return _margin(loop, _scaled_norm) if loop.is_stable else NO_MARGIN


def _margin(loop: BrokenLoop, size: Callable[[np.ndarray], np.ndarray]) -> DiscMargin:
    grid, sizes = loop.frequencies, size(loop.values)
    for _ in range(_REFINEMENTS):
        peak = int(np.argmax(sizes))
        low, high = grid[max(peak - 1, 0)], grid[min(peak + 1, len(grid) - 1)]
        grid = np.unique(np.append(np.linspace(low, high, _FINER), grid[peak]))
        sizes = size(loop(grid))
    peak = int(np.argmax(sizes))
    return DiscMargin(min(2.0 / float(sizes[peak]), 2.0), float(grid[peak]))


def _of_drive(i: int, M: np.ndarray) -> np.ndarray:
    """Return ``|S - T|`` of one drive."""
    return np.abs(M[:, i, i])


def _scaled_norm(M: np.ndarray) -> np.ndarray:
    """Return the least ``|D M D^-1|_2`` over diagonal D, nearly, by balancing (Osborne)."""
    M = M.copy()
    diagonal = np.arange(M.shape[-1])
    for _ in range(_BALANCING):
        largest = 0.0
        for i in diagonal:
            others = diagonal != i
            row = np.linalg.norm(M[:, i, others], axis=1)
            column = np.linalg.norm(M[:, others, i], axis=1)
            # a drive that is alone, one way, keeps its scale
            alone = (row == 0.0) | (column == 0.0)
            factor = np.sqrt(np.where(alone, 1.0, column) / np.where(alone, 1.0, row))
            M[:, i, :] *= factor[:, None]
            M[:, :, i] /= factor[:, None]
            largest = max(largest, float(np.max(np.abs(np.log(factor)))))
        if largest < _BALANCED:
            break
    return np.linalg.norm(M, 2, axis=(1, 2))


MOST = 50  # sampling intervals that are tried


def delayed(A: np.ndarray, holds: np.ndarray, intervals: int) -> np.ndarray:
    """Return the map of a loop whose drives get what they are told some intervals later.

    Args:
        A: Map of one sampling interval, shape (n, n).
        holds: Index of each drive's held command, shape (N,).
        intervals: Further delay in sampling intervals.

    Returns:
        Shape (n + intervals N, n + intervals N); behind the loop's own variables those of the
        bus, newest first.
    """
    n, N = len(A), len(holds)
    result = np.zeros((n + intervals * N, n + intervals * N))
    result[:n, :n] = A
    if intervals == 0:
        return result
    # the last on the bus acts in place of what has just been told
    result[:n, holds] = 0.0
    result[:n, n + (intervals - 1) * N :] = A[:, holds]
    result[np.arange(n, n + N), holds] = 1.0
    shifted = np.arange((intervals - 1) * N)
    result[n + N + shifted, n + shifted] = 1.0
    return result


def delay_margin(A: np.ndarray, holds: np.ndarray, period: float) -> int:
    """Return how many further sampling intervals of delay in all drives a loop bears.

    Args:
        A: Map of one sampling interval, shape (n, n).
        holds: Index of each drive's held command, shape (N,).
        period: Sampling time [s].

    Returns:
        -1 if the loop is unstable as it is; at most ``MOST``.
    """
    for intervals in range(MOST + 1):
        if not modes(delayed(A, holds, intervals), period).is_stable:
            return intervals - 1
    return MOST
