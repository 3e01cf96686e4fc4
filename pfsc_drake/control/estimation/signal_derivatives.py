"""Derivatives of a sampled signal, as they are known at the last sample."""

import math

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
    Smoothing and Prediction, 1969.)

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

    def start(self, sample: np.ndarray) -> np.ndarray:
        """Return the state of a signal that has always been at rest.

        Args:
            sample: First sample, shape (N,).

        Returns:
            Shape (k + 1, N).
        """
        state = np.zeros((len(self.gain), len(sample)))
        state[0] = sample
        return state

    def estimate(self, state: np.ndarray, sample: np.ndarray) -> np.ndarray:
        """Return the signal and its derivatives at a sample, one row each.

        Args:
            state: Prediction for this sample, shape (k + 1, N).
            sample: Shape (N,).

        Returns:
            Shape (k + 1, N) [unit, unit/s, ..].
        """
        return state + np.outer(self.gain, sample - state[0])

    def predict(self, estimate: np.ndarray) -> np.ndarray:
        """Return the state for the next sample, shape (k + 1, N)."""
        return self.transition @ estimate


def _taylor(period: float, order: int) -> float:
    return period**order / math.factorial(order) if order >= 0 else 0.0
