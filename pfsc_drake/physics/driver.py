"""Driver model: low pass and rates of commanded torques."""

import math
from typing import Any

import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values

_OF_EFFORT = 10.0  # 1/s


def low_pass_share(cutoff: float, period: float) -> float:
    """Return by which share of what is left a low pass of first order goes on at a tick.

    Args:
        cutoff: Cut-off frequency [Hz]; 0 for none.
        period: Sampling time [s].
    """
    w = 2.0 * math.pi * cutoff * period
    return w / (1.0 + w) if cutoff > 0.0 else 1.0


def torque_rates(rate: float, effort: np.ndarray) -> np.ndarray:
    """Return how fast torques may change [Nm/s], shape (N,).

    Args:
        rate: Of joints like a Panda's [Nm/s].
        effort: Largest torques [Nm], shape (N,).
    """
    return np.maximum(rate, _OF_EFFORT * np.where(np.isfinite(effort), effort, 0.0))


class DriveLowPass(Block):
    """A low pass of first order, as drivers have it against steps of torque.

    Ports:
        told (input): Torques [Nm or N], shape (N,).
        passed (output): The same through the low pass, shape (N,).

    State:
        What was ``passed`` last; at the start what is told.

    Args:
        size: N.
        cutoff: Cut-off frequency, positive [Hz].
        period: Sampling time [s].
    """

    def __init__(self, size: int, cutoff: float, period: float) -> None:
        self._share = low_pass_share(cutoff, period)
        self.inputs, self.outputs = {"told": Port(size)}, {"passed": Port(size)}
        self.states = {"passed": size}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the start; what is left out is zero."""
        return {"passed": u.told}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"passed": x.passed + self._share * (u.told - x.passed)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return what is remembered at the next tick; what is left out stays."""
        return {"passed": y.passed}
