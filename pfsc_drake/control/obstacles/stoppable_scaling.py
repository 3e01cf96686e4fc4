"""Speed scaling that can be stopped within the time that is left."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import casadi as ca
import numpy as np
from scipy.special import gammainccinv

from pfsc_drake.blocks.cases import where
from pfsc_drake.yaml.rules import Parameters, Positive, Range

# time multiplied by bandwidth after which the scaling is zero
_LONGEST = 60.0


@dataclass(frozen=True)
class StoppableScaling(Parameters):
    """Speed scaling through lags, and the largest request that can be stopped within a time.

    The speed scaling ``z_1`` of a motion follows the request ``0 <= w <= 1`` through r lags,
    ``z_k' = omega (z_{k+1} - z_k)``, ``z_{r+1} = w``, see :class:`~pfsc_drake.control.law.
    timed_reference.TimedReference`. After w becomes 0, it decreases from 1 no slower than

        Q(x) = e^{-x} sum_{k < r} x^k / k!,    x = omega t,

    and the motion time ``s`` comes to rest at ``rest = s + (z_1 + .. + z_r) / omega``. It follows
    that ``rest' = w``: the stopping point moves exactly at the requested scaling.

    Let b be the time until a point of the path between ``s`` and ``rest`` may be obstructed. Let
    ``c_k`` be the largest of ``z_k, .., z_r``, an upper bound of the lags that decays for w = 0:
    its ``z_1`` after b is ``sum a_k c_k``, ``a_k = e^{-x} x^(k-1) / (k-1)!``, ``x = omega b``. The
    permitted scaling is the largest w to which these lags may be filled, so that
    ``sum a_k max(c_k, w) <= resting``:

        W(b, z) = min_{i < r} (resting - sum_{k <= i} a_k c_k) / sum_{k > i} a_k,

    limited to 0 .. 1, and 0 if b <= 0. If b decreases no faster than time passes, and w <= W for
    all points between ``s`` and ``rest``, then no point is passed faster than ``resting`` after
    its b has elapsed. The same holds backwards, ``-1 <= w <= 0``, for the absolute values, if the
    motion reverses at rest.

    Attributes:
        order: Number r of lags, 1 to 4 for the laws of this project.
        bandwidth: Bandwidth omega [1/s].
        resting: Scaling that counts as rest.

    Raises:
        InputError: If the bandwidth is not positive, or ``resting`` is out of range.
    """

    order: int
    bandwidth: Positive
    resting: Annotated[float, Range(0.0001, 0.5, "of the planned speed")]

    @property
    def time_to_stop(self) -> float:
        """Time from any scaling to rest after the request becomes 0 [s]."""
        return float(gammainccinv(self.order, self.resting)) / self.bandwidth

    @property
    def lag(self) -> float:
        """Difference between ``rest`` and the motion time at a steady scaling of 1 [s]."""
        return self.order / self.bandwidth

    def decay(self, time: Any) -> Any:
        """Return ``Q``, the scaling that remains after a time with a request of 0.

        Args:
            time: Time [s], number or expression, any shape.
        """
        x = self.bandwidth * time
        terms = [x**k / math.factorial(k) for k in range(self.order)]
        return ca.exp(-x) * sum(terms[1:], terms[0])

    def largest_request(self, time: Any, lags: Sequence[Any]) -> Any:
        """Return ``W``, the largest permitted request.

        Args:
            time: Time b [s], number or expression.
            lags: States ``z_1`` to ``z_r``.
        """
        x = self.bandwidth * ca.fmin(ca.fmax(time, 0.0), _LONGEST / self.bandwidth)
        shares = [ca.exp(-x) * x**k / math.factorial(k) for k in range(self.order)]
        fill = list(itertools.accumulate([ca.fabs(lag) for lag in reversed(lags)], ca.fmax))[::-1]
        spent, most = 0.0, 1.0
        for i in range(self.order):
            most = ca.fmin(most, (self.resting - spent) / sum(shares[i + 1 :], shares[i]))
            spent = spent + shares[i] * fill[i]
        return where(time > 0.0, where(spent <= self.resting, ca.fmax(most, 0.0), 0.0), 0.0)

    def lags(self, rates: Sequence[Any]) -> list[Any]:
        """Return ``z_1`` to ``z_r``.

        Args:
            rates: Scaling ``z_1`` and its derivatives 1 to r - 1.
        """
        # z_{k+1} = z_k + z_k' / omega
        row, found = list(rates), [rates[0]]
        for _ in range(self.order - 1):
            row = [a + b / self.bandwidth for a, b in itertools.pairwise(row)]
            found.append(row[0])
        return found

    def rest(self, s: Any, lags: Sequence[Any]) -> Any:
        """Return the motion time at rest after the request becomes 0 [s].

        Args:
            s: Motion time [s].
            lags: States ``z_1`` to ``z_r``.
        """
        return s + sum(lags[1:], lags[0]) / self.bandwidth

    def stop(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return travel and rates of a stop from a scaling of 1.

        Args:
            x: Time since the begin of the stop, times the bandwidth, shape (samples,).

        Returns:
            Travel in motion time [s], shape (samples,), and ``z_1`` with its derivatives 1 to 3,
            shape (samples, 4) [1, 1/s, ..].
        """
        r, omega = self.order, self.bandwidth
        # Q' = -x^(r-1) e^-x / (r-1)!, a polynomial times e^-x
        fading = np.polynomial.Polynomial([1.0 / math.factorial(k) for k in range(r)])
        rates: list[np.ndarray] = []
        for _ in range(4):
            rates.append(fading(x) * np.exp(-x) * omega ** len(rates))
            fading = fading.deriv() - fading
        ahead = np.polynomial.Polynomial([(r - k) / math.factorial(k) for k in range(r)])
        return (r - ahead(x) * np.exp(-x)) / omega, np.array(rates).T
