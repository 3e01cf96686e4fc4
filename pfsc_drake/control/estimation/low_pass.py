"""A low-pass filter, sampled."""

from typing import TypeVar

import casadi as ca
import numpy as np

from pfsc_drake.errors import InputError

Signal = TypeVar("Signal", np.ndarray, ca.SX)


class LowPass:
    """First-order low-pass ``1 / (1 + s / w_c)``, sampled, with its output in the same tick.

    By the trapezoidal rule with ``w = tan(w_c T / 2)``: damped to ``1 / sqrt(2)`` exactly
    at the bandwidth, with a gain of exactly one at rest. Samples and states may be arrays
    or expressions.

    Args:
        bandwidth: ``w_c / (2 pi)`` [Hz].
        period: Sampling time T [s].

    Raises:
        InputError: If the bandwidth is not between zero and half the sampling rate.
    """

    def __init__(self, bandwidth: float, period: float) -> None:
        highest = 0.5 / period
        if not 0.0 < bandwidth < highest:
            raise InputError(
                f"bandwidth = {bandwidth} Hz: must be positive and below half the sampling "
                f"rate, {highest:g} Hz"
            )
        w = float(np.tan(np.pi * bandwidth * period))
        self._gain, self._decay = w / (1.0 + w), (1.0 - w) / (1.0 + w)
        self._rate = 2.0 * w / period

    def rest(self, sample: Signal) -> Signal:
        """Return the state in which the filter rests on a sample."""
        return (1.0 - self._gain) * sample

    def output(self, state: Signal, sample: Signal) -> Signal:
        """Return the filtered sample of this tick."""
        return self._gain * sample + state

    def update(self, state: Signal, sample: Signal) -> Signal:
        """Return the state for the next tick."""
        return self._gain * sample + self._decay * self.output(state, sample)

    def derivative(self, state: Signal, sample: Signal) -> Signal:
        """Return the filtered derivative ``s / (1 + s / w_c)`` of the sample, in this tick."""
        return self._rate * (sample - self.output(state, sample))
