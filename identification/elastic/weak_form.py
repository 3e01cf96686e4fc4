"""Equations of motion without derivatives of measured signals: modulating functions.

An equation ``tau = I q'' + K q + ...`` is convolved with a smooth function ``phi`` of finite
length. The derivatives then fall on ``phi``::

    phi * tau = I (phi'' * q) + K (phi * q) + ...

which holds exactly, whatever the motion was before and after, periodic or not. Here ``phi`` is the
B-spline of degree 5, sampled; sums stand for integrals, with errors that fall with the sixth power
of its knots' distance.
"""

from dataclasses import dataclass
from math import comb

import numpy as np
from scipy.interpolate import BSpline
from scipy.signal import fftconvolve

_DEGREE = 5
_ORDER = 6  # of the difference that leaves nothing but noise of a smooth signal


@dataclass(frozen=True, eq=False)
class TestFunction:
    """A B-spline and its derivatives at the samples.

    Attributes:
        kernels: Of the derivatives 0, 1, 2, shape (3, 2 H + 1).
    """

    __test__ = False  # of the weak form, none of the tests'

    kernels: np.ndarray

    @classmethod
    def of_knots(cls, spacing: float, step: float) -> "TestFunction":
        """Return the function for a distance of its knots.

        Args:
            spacing: Distance of the knots [s]; the function is six times as long.
            step: Sampling time [s].
        """
        knots = (np.arange(_DEGREE + 2) - 0.5 * (_DEGREE + 1)) * spacing
        spline = BSpline.basis_element(knots, extrapolate=False)
        half = int(np.ceil(knots[-1] / step)) - 1
        t = np.arange(-half, half + 1) * step
        rows = [spline(t), *(spline.derivative(order)(t) for order in (1, 2))]
        return cls(np.nan_to_num(np.array(rows)) * step / spacing)

    @property
    def half(self) -> int:
        """Samples H on either side of its middle."""
        return int(self.kernels.shape[1] // 2)

    def derivative(self, signal: np.ndarray, order: int = 0) -> np.ndarray:
        """Return the convolution of a signal with a derivative of the function, shape (K - 2 H,).

        Args:
            signal: Shape (K,).
            order: 0, 1 or 2.
        """
        return np.asarray(fftconvolve(signal, self.kernels[order], mode="valid"))


def white_noise(signal: np.ndarray) -> float:
    """Return the standard deviation of the white noise on a smooth signal.

    A difference of order 6 leaves next to nothing of what changes slowly compared to the samples.

    Args:
        signal: Evenly sampled, shape (K,).
    """
    left = np.diff(signal, _ORDER)
    return float(np.sqrt(np.mean(left**2) / comb(2 * _ORDER, _ORDER)))


def mean_sign(v: np.ndarray) -> np.ndarray:
    """Return the mean of a velocity's sign over the sampling time about each sample, shape (K,).

    The velocity changes evenly between ``v_1`` and ``v_2`` in the middles before and after the
    sample: ``(v_1 + v_2) / (|v_1| + |v_2|)``.

    Args:
        v: In the middles between K samples, shape (K - 1,).
    """
    before, after = np.append(v[0], v), np.append(v, v[-1])
    size = np.maximum(np.abs(before) + np.abs(after), np.finfo(float).tiny)
    return np.asarray((before + after) / size)


def long_run_covariance(scores: np.ndarray, length: int) -> np.ndarray:
    """Return the covariance of a sum of correlated vectors, shape (n, n) (Bartlett's weights).

    Args:
        scores: The vectors, mean zero, shape (K, n).
        length: Samples after which nothing correlates any more.
    """
    sums = np.array([fftconvolve(column, np.ones(length)) for column in scores.T])
    return np.asarray(sums @ sums.T / length)
