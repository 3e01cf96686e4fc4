"""Disc margins: how wrong gain and phase of the drives may be.

The loop ``x_{k+1} = A x_k`` is looked at where commands are held: variable ``h_i`` of x is what
drive i is told for the coming interval. Adding w to it gives ``h_i = -T_i w`` with the
complementary sensitivity ``T_i(z) = -e_i' (z I - A)^-1 A e_i``, the loop's gain being
``L = T / (1 - T)``. The symmetric disc margin (Seiler, Packard, Gahinet: An Introduction to Disk
Margins, 2020) is::

    alpha = 1 / max |S - T| / 2,   S = 1 - T

and the loop stays stable when L is multiplied by any complex number in the disc through
``(2 - alpha) / (2 + alpha)`` and its inverse: gain and phase may be wrong at the same time.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import scipy.linalg

from pfsc_drake.control.margins.modes import modes

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
