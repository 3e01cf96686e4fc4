"""Driver model: low-pass filter and rate limits of commanded torques."""

import math
from typing import Any

import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values

_OF_EFFORT = 10.0  # 1/s


def low_pass_share(cutoff: float, period: float) -> float:
    """Return the share of the remaining error that a first-order low-pass removes at a tick.

    Args:
        cutoff: Cut-off frequency [Hz]; 0 for none.
        period: Sampling time [s].
    """
    w = 2.0 * math.pi * cutoff * period
    return w / (1.0 + w) if cutoff > 0.0 else 1.0


def torque_rates(rate: float, effort: np.ndarray) -> np.ndarray:
    """Return the largest rates of torques [Nm/s], shape (N,).

    Args:
        rate: Rate limit of joints like a Panda's [Nm/s].
        effort: Largest torques [Nm], shape (N,).
    """
    return np.maximum(rate, _OF_EFFORT * np.where(np.isfinite(effort), effort, 0.0))


class DriveLowPass(Block):
    """First-order low-pass filter of a driver, which smooths steps of torque.

    Ports:
        command (input): Commanded torques [Nm or N], shape (N,).
        passed (output): Filtered torques, shape (N,).

    State:
        The last output (``passed``); initially the command.

    Args:
        size: N.
        cutoff: Cut-off frequency, positive [Hz].
        period: Sampling time [s].
    """

    def __init__(self, size: int, cutoff: float, period: float) -> None:
        self._share = low_pass_share(cutoff, period)
        self.inputs, self.outputs = {"command": Port(size)}, {"passed": Port(size)}
        self.states = {"passed": size}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial states; omitted ones are zero."""
        return {"passed": u.command}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"passed": x.passed + self._share * (u.command - x.passed)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        return {"passed": y.passed}
