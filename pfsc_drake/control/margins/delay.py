"""Delay that a sampled loop bears between command and drive."""

import numpy as np

from pfsc_drake.control.margins.modes import modes

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
