"""Stability margins of a sampled linear loop: modes, disc margins of the drives, and delay."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import scipy.linalg
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

# 1/s; slower modes are neutral: variables without feedback
NEUTRAL = 0.1
_SMALLEST = 1e-300


@dataclass(frozen=True)
class Modes:
    """Modes of a sampled loop, the slowest first.

    Attributes:
        rate: ``log|lambda| / T_s`` [1/s], shape (k,); positive grows.
        frequency: ``|arg lambda| / T_s`` [rad/s], shape (k,).
        neutral: Number of modes that neither grow nor decay; they are not included above.
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
        """Whether no mode grows."""
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
    """Return the variables that are part of a feedback loop.

    Counters, overwritten memories, integrals without gain and disturbances are not; the others do
    not depend on them.

    Args:
        changes: Whether the variable of the column changes the one of the row, shape (n, n).
        core: Whether a variable belongs to the controlled system itself, shape (n,).

    Returns:
        Shape (n,): whether a variable is changed by the core and changes it, directly or
        indirectly; including the core.
    """
    reached = _reachable(changes, core)
    reaching = _reachable(changes.T, core)
    return core | (reached & reaching)


def _reachable(changes: np.ndarray, core: np.ndarray) -> np.ndarray:
    """Return the variables changed by the core, directly or indirectly, and the core."""
    n = len(core)
    # one more node that changes all of the core
    graph = np.zeros((n + 1, n + 1), dtype=bool)
    graph[:n, :n], graph[n, :n] = changes.T, core
    found = breadth_first_order(csr_array(graph), n, return_predecessors=False)
    reached = np.zeros(n + 1, dtype=bool)
    reached[found] = True
    return reached[:n]


_POINTS = 400  # frequencies of the first grid
_SLOWEST = 0.01  # rad/s; neutral modes are at 0
_REFINEMENTS, _FINER = 3, 20
_BALANCING = 30  # sweeps at most
_BALANCED = 1e-3


@dataclass(frozen=True)
class DiscMargin:
    """Tolerated gain and phase errors of a loop.

    Attributes:
        alpha: Disc margin, 0 (none) to 2 (any gain).
        frequency: Frequency of the smallest margin [rad/s].
    """

    alpha: float
    frequency: float

    @property
    def gain(self) -> tuple[float, float]:
        """Least and largest tolerated factor of the gain."""
        if self.alpha >= 2.0:
            return 0.0, np.inf
        return (2.0 - self.alpha) / (2.0 + self.alpha), (2.0 + self.alpha) / (2.0 - self.alpha)

    @property
    def phase(self) -> float:
        """Tolerated phase error [rad]."""
        return 2.0 * float(np.arctan(self.alpha / 2.0))


NO_MARGIN = DiscMargin(0.0, 0.0)


class BrokenLoop:
    """``S - T`` of a loop broken at its holds.

    With the Schur form ``A = Q R Q^H`` every frequency needs only a triangular system.

    Args:
        A: Map of one sampling interval, shape (n, n).
        holds: Index of each drive's held command, shape (N,).
        period: Sampling time [s].

    Attributes:
        num_drives: N.
        is_stable: Whether no mode grows.
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
    """Return the disc margin of every drive, with the others unchanged.

    Args:
        loop: The loop, N drives.

    Returns:
        No margins if the loop is unstable.
    """
    if not loop.is_stable:
        return [NO_MARGIN] * loop.num_drives
    return [_margin(loop, partial(_of_drive, i)) for i in range(loop.num_drives)]


def common_disc_margin(loop: BrokenLoop) -> DiscMargin:
    """Return a disc margin for independent simultaneous errors of all drives.

    The structured singular value is bounded by scaling the drives, so that the loop tolerates at
    least the returned margin.

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
            # a drive without coupling in one direction retains its scale
            alone = (row == 0.0) | (column == 0.0)
            factor = np.sqrt(np.where(alone, 1.0, column) / np.where(alone, 1.0, row))
            M[:, i, :] *= factor[:, None]
            M[:, :, i] /= factor[:, None]
            largest = max(largest, float(np.max(np.abs(np.log(factor)))))
        if largest < _BALANCED:
            break
    return np.linalg.norm(M, 2, axis=(1, 2))


MOST = 50  # largest delay in sampling intervals


def with_delay(A: np.ndarray, holds: np.ndarray, intervals: int) -> np.ndarray:
    """Return the map of a loop whose commands reach the drives some intervals later.

    Args:
        A: Map of one sampling interval, shape (n, n).
        holds: Index of each drive's held command, shape (N,).
        intervals: Further delay in sampling intervals.

    Returns:
        Shape (n + intervals N, n + intervals N); the loop's own variables, then the
        variables of the bus, newest first.
    """
    n, N = len(A), len(holds)
    result = np.zeros((n + intervals * N, n + intervals * N))
    result[:n, :n] = A
    if intervals == 0:
        return result
    # the oldest command on the bus acts instead of the newest one
    result[:n, holds] = 0.0
    result[:n, n + (intervals - 1) * N :] = A[:, holds]
    result[np.arange(n, n + N), holds] = 1.0
    shifted = np.arange((intervals - 1) * N)
    result[n + N + shifted, n + shifted] = 1.0
    return result


def delay_margin(A: np.ndarray, holds: np.ndarray, period: float) -> int:
    """Return the delay margin of all drives in sampling intervals.

    Args:
        A: Map of one sampling interval, shape (n, n).
        holds: Index of each drive's held command, shape (N,).
        period: Sampling time [s].

    Returns:
        -1 if the loop is unstable without further delay; at most ``MOST``.
    """
    for intervals in range(MOST + 1):
        if not modes(with_delay(A, holds, intervals), period).is_stable:
            return intervals - 1
    return MOST
