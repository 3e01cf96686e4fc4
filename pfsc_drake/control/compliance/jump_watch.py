"""Jumps of a force/torque sensor: steps that its amplifier would not let through."""

from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.cases import any_of

# of a step: by what the first and the second sample after it may differ from where it led
_FLAT = (0.03, 0.11)
# standard deviations of the noise: of the difference of two samples, and of steps that are judged
_NOISE, _JUDGED = 6.0 * np.sqrt(2.0), 50.0
# of a step, the least that must follow in the next sample where it has gone through an amplifier
_LEAST_TAIL = 2.0 * _FLAT[0]
_SAMPLES = 3


class JumpWatch:
    """Finds loads on a sensor that jump as no force does.

    A force reaches the reading through the amplifier's first-order filter. If it steps, by
    whatever size, the next sample still changes by ``exp(-2 pi bandwidth period)`` of the first
    step, and the force of an impact falls off again. A load that changes by more than
    ``smallest`` within one sample and then stays where it is, by 3 % of the step in the first
    sample and by 11 % in the second, is the sensor's, not the environment's; it is found in the
    second. Steps below 50 standard deviations of the noise are not judged; none is of a
    sensor whose bandwidth is beyond 0.45 of the sampling rate, since it lets steps through.

    Args:
        smallest: Steps that are judged, shape (6,) [N, Nm]; infinite for none.
        noise: Standard deviation of a sample, shape (6,) [N, Nm].
        bandwidth: That of the amplifier [Hz].
        period: Sampling time [s].

    Attributes:
        size: Number of values that are remembered.
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
            load: Load on the sensor beside the tool's own, shape (6,) [N, Nm].
            memory: The three loads before, the last one first, shape (18,).
            at_range: Whether each reading is at the end of its range, where it stays, shape (6,).
        """
        after, there, before = ca.vertsplit(memory, 6)
        size = ca.fabs(there - before)
        flat = [
            ca.fabs(later - there) <= share * size + self._noise
            for share, later in zip(_FLAT, (after, load), strict=True)
        ]
        jumped = (size > self._judged) * flat[0] * flat[1] * ca.logic_not(at_range)
        return any_of(jumped), ca.vertcat(load, after, there)
