"""The pace at which a motion can be stopped in the time that is left."""

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

# times by bandwidth, after which nothing is left of a pace
_LONGEST = 60.0


@dataclass(frozen=True)
class WaitingPace(Parameters):
    """How fast a reference may go that can be stopped within a time, whatever has been before.

    The pace ``z_1`` of a motion follows what is asked for, ``0 <= w <= 1``, through r lags,
    ``z_k' = omega (z_{k+1} - z_k)``, ``z_{r+1} = w``, see :class:`~pfsc_drake.control.law.
    timed_reference.TimedReference`. If nothing more is asked for it falls from 1 at worst as

        Q(x) = e^{-x} sum_{k < r} x^k / k!,    x = omega t,

    and the own time ``s`` of the motion comes to rest at ``rest = s + (z_1 + .. + z_r) / omega``.
    It follows ``rest' = w``: where the motion would stop moves exactly at the pace that is asked
    for.

    Be b the time until something may be in the way at a place between ``s`` and ``rest``. Be
    ``c_k`` the largest of ``z_k, .., z_r``, lags at least as full as these, that would only empty
    if w was 0: their ``z_1`` after b is ``sum a_k c_k``, ``a_k = e^{-x} x^(k-1) / (k-1)!``,
    ``x = omega b``. The pace that is permitted is the largest w to which these lags may be filled
    up, so that ``sum a_k max(c_k, w) <= resting``:

        W(b, z) = min_{i < r} (resting - sum_{k <= i} a_k c_k) / sum_{k > i} a_k,

    within 0 and 1, and 0 if b <= 0. If b falls no faster than time goes on, and w <= W for all
    places between ``s`` and ``rest``, then no place is passed faster than ``resting`` when its b
    is used up. The same holds backwards, ``-1 <= w <= 0``, for the sizes of all of them, if it
    turns at rest.

    Attributes:
        order: r, 1 to 4 for the laws of this project.
        bandwidth: omega [1/s].
        resting: Share of the planned pace that counts as rest.

    Raises:
        InputError: If the bandwidth is not positive, or nothing or all counts as rest.
    """

    order: int
    bandwidth: Positive
    resting: Annotated[float, Range(0.0001, 0.5, "of the planned pace")]

    @property
    def time_to_stop(self) -> float:
        """Time from any pace until it rests, if nothing more is asked for [s]."""
        return float(gammainccinv(self.order, self.resting)) / self.bandwidth

    @property
    def lag(self) -> float:
        """By how much the own time is behind its rest at a steady pace of 1 [s]."""
        return self.order / self.bandwidth

    def left(self, time: Any) -> Any:
        """Return ``Q``, what is left of the pace after a time without being asked for.

        Args:
            time: [s], number or expression, any shape.
        """
        x = self.bandwidth * time
        terms = [x**k / math.factorial(k) for k in range(self.order)]
        return ca.exp(-x) * sum(terms[1:], terms[0])

    def permitted(self, time: Any, lags: Sequence[Any]) -> Any:
        """Return ``W``, the pace that may be asked for.

        Args:
            time: b [s], number or expression.
            lags: ``z_1`` to ``z_r``.
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
            rates: ``z_1`` and its derivatives 1 to r - 1.
        """
        # z_{k+1} = z_k + z_k' / omega
        row, found = list(rates), [rates[0]]
        for _ in range(self.order - 1):
            row = [a + b / self.bandwidth for a, b in itertools.pairwise(row)]
            found.append(row[0])
        return found

    def rest(self, s: Any, lags: Sequence[Any]) -> Any:
        """Return where the own time comes to rest if nothing more is asked for [s].

        Args:
            s: The own time [s].
            lags: ``z_1`` to ``z_r``.
        """
        return s + sum(lags[1:], lags[0]) / self.bandwidth

    def stop(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return way and rates of a stop from a pace of 1.

        Args:
            x: Time since it began, times the bandwidth, shape (samples,).

        Returns:
            Way in own time [s], shape (samples,), and ``z_1`` with its derivatives 1 to 3, shape
            (samples, 4) [1, 1/s, ..].
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
