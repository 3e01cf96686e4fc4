"""Jumps of a force/torque sensor: steps that its amplifier cannot transmit."""

from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.cases import any_of

# shares of a step by which the first and the second sample after it may differ from its level
_FLAT = (0.03, 0.11)
# standard deviations of the noise: of the difference of two samples, and of steps that are judged
_NOISE, _JUDGED = 6.0 * np.sqrt(2.0), 50.0
# least share of a step that follows in the next sample behind an amplifier
_LEAST_TAIL = 2.0 * _FLAT[0]
_SAMPLES = 3


class JumpWatch:
    """Detects steps of a measured load that no force can cause.

    A force reaches the reading through the amplifier's first-order filter. After a step of any
    size, the next sample still changes by ``exp(-2 pi bandwidth period)`` of the first change, and
    the force of an impact decreases again. A load that changes by more than ``smallest`` within one
    sample and then stays constant, within 3 % of the step in the first sample and 11 % in the
    second, is a fault of the sensor; it is detected in the second sample. Steps below 50 standard
    deviations of the noise are ignored, and so are all steps of a sensor whose bandwidth is above
    0.45 of the sampling rate, which transmits steps.

    Args:
        smallest: Smallest steps that are detected, shape (6,) [N, Nm]; infinite for none.
        noise: Standard deviation of a sample, shape (6,) [N, Nm].
        bandwidth: Bandwidth of the amplifier [Hz].
        period: Sampling time [s].

    Attributes:
        size: Size of the memory.
    """

    size = 6 * _SAMPLES

    def __init__(
        self, smallest: np.ndarray, noise: np.ndarray, bandwidth: float, period: float
    ) -> None:
        tail = np.exp(-2.0 * np.pi * bandwidth * period)
        deviation = np.asarray(noise, dtype=float)
        judged = np.fmax(np.asarray(smallest, dtype=float), _JUDGED * deviation)
        self._judged = ca.DM(judged if tail > _LEAST_TAIL else np.full(6, np.inf))
        self._noise = ca.DM(_NOISE * deviation)

    def step(self, load: Any, memory: Any, at_range: Any) -> tuple[Any, Any]:
        """Return whether the load has jumped two samples ago, and the next memory.

        Args:
            load: Load on the sensor less the tool's load, shape (6,) [N, Nm].
            memory: The three previous loads, the last one first, shape (18,).
            at_range: Whether each reading is saturated, shape (6,).
        """
        after, there, before = ca.vertsplit(memory, 6)
        size = ca.fabs(there - before)
        flat = [
            ca.fabs(later - there) <= share * size + self._noise
            for share, later in zip(_FLAT, (after, load), strict=True)
        ]
        jumped = (size > self._judged) * flat[0] * flat[1] * ca.logic_not(at_range)
        return any_of(jumped), ca.vertcat(load, after, there)
