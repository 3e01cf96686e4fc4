"""Oscillation of drive commands, the first sign of an unstable loop."""

import numpy as np
from pydrake.systems.framework import Context

from diagrams.signal_log import SignalLog
from pfsc_drake.control.law.following_law import FollowingLaw

# s, over which commands are examined
WINDOW = 0.1
# least amplitude as a share of the drive's limit, and least number of swings within the window
_SHARE, _SWINGS = 0.25, 8


def oscillating_drives(commands: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """Return the drives whose commands oscillate, by index.

    A drive oscillates if its command goes up and down, in turns, by a quarter of its limit or more
    each time, eight times or more.

    Args:
        commands: Samples of the last :data:`WINDOW`, shape (samples, N).
        limits: Limits of the commands, shape (N,); one without a limit never oscillates.
    """
    counts = [
        _swings(command, _SHARE * limit) for command, limit in zip(commands.T, limits, strict=True)
    ]
    return np.flatnonzero(np.array(counts) >= _SWINGS)


def _swings(values: np.ndarray, least: float) -> int:
    """Return how often values go up or down by at least so much, in turns."""
    count, direction, low, high = 0, 0, np.inf, -np.inf
    for value in values:
        low, high = min(low, value), max(high, value)
        if direction >= 0 and high - value >= least:
            count, direction, low, high = count + 1, -1, value, value
        elif direction <= 0 and value - low >= least:
            count, direction, low, high = count + 1, 1, value, value
    return count


def oscillation_before(time: float, log: SignalLog, root: Context, law: FollowingLaw) -> np.ndarray:
    """Return the drives whose commands oscillated before an instant, by index.

    Args:
        time: The instant [s].
        log: Log with the commands to the drives.
        root: Context of the diagram.
        law: The law.
    """
    times, signals = log.read(root)
    recent = (times > time - WINDOW) & (times < time)
    return oscillating_drives(signals["law"][recent, law.layout.drive], law.limits)
