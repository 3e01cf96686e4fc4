"""Filters of sampled signals: derivatives at the last sample, and a low-pass."""

import math
from typing import Any, TypeVar

import casadi as ca
import numpy as np

from pfsc_drake.errors import InputError

_MOST = 2


class SignalDerivatives:
    """Fading-memory polynomial filter: a signal and its derivatives from its samples.

    A polynomial of degree k is fitted by least squares to all samples so far, the square of
    each weighed by ``beta^age``, ``beta = exp(-bandwidth period)``. As a recursion with the
    state ``x``, which is the polynomial's prediction for the next sample::

        estimate = x + G (sample - x_0),    x_next = Phi estimate

    with the Taylor matrix Phi; all poles of the error are at beta. Signals that are
    polynomials of degree k are followed without lag. (N. Morrison, Introduction to Sequential
    Smoothing and Prediction, 1969.) Samples and states are numbers (``casadi.DM``) or expressions.

    Args:
        num_derivatives: Degree k, 0 to 2.
        bandwidth: Rate at which old samples are forgotten [rad/s].
        period: Sampling time [s].

    Attributes:
        gain: G, shape (k + 1,).
        transition: Phi, shape (k + 1, k + 1).

    Raises:
        InputError: If a number is out of range.
    """

    def __init__(self, num_derivatives: int, bandwidth: float, period: float) -> None:
        if not 0 <= num_derivatives <= _MOST:
            raise InputError(f"number of derivatives: {num_derivatives}; must be 0 to {_MOST}")
        if not 0.0 < bandwidth * period < math.inf:
            raise InputError(
                f"bandwidth = {bandwidth} rad/s with a period of {period} s: must be positive"
            )
        beta = math.exp(-bandwidth * period)
        fresh = 1.0 - beta
        self.gain = np.array(
            [
                [fresh],
                [1.0 - beta**2, fresh**2 / period],
                [1.0 - beta**3, 1.5 * fresh**2 * (1.0 + beta) / period, fresh**3 / period**2],
            ][num_derivatives]
        )
        orders = range(num_derivatives + 1)
        self.transition = np.array(
            [[_taylor(period, column - row) for column in orders] for row in orders]
        )

    def start(self, sample: Any) -> Any:
        """Return the state for a signal that has always been at rest.

        Args:
            sample: First sample, shape (N,).

        Returns:
            Shape ((k + 1) N,).
        """
        return ca.vertcat(sample, ca.DM.zeros(sample.numel() * (len(self.gain) - 1)))

    def estimate(self, state: Any, sample: Any) -> Any:
        """Return the signal and its derivatives at a sample, one after another.

        Args:
            state: Prediction for this sample, shape ((k + 1) N,).
            sample: Shape (N,).

        Returns:
            Shape ((k + 1) N,) [unit, unit/s, ..].
        """
        predicted = self._by_columns(state)
        innovation = sample - predicted[:, 0]
        return ca.vec(predicted + innovation @ ca.DM(self.gain).T)

    def predict(self, estimate: Any) -> Any:
        """Return the state for the next sample.

        Args:
            estimate: Signal and derivatives at this sample, shape ((k + 1) N,).

        Returns:
            Shape ((k + 1) N,).
        """
        return ca.vec(self._by_columns(estimate) @ ca.DM(self.transition).T)

    def _by_columns(self, values: Any) -> Any:
        """Return signal, first derivative, .. as columns, shape (N, k + 1)."""
        return ca.reshape(values, -1, len(self.gain))


def _taylor(period: float, order: int) -> float:
    return period**order / math.factorial(order) if order >= 0 else 0.0


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
