"""The pace at which a motion can be stopped in the time that is left."""

import itertools
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq
from scipy.special import gammaincc, gammainccinv

from pfsc_drake.blocks.cases import where
from pfsc_drake.checks import require_between, require_positive

# steps, and the times by bandwidth, over which a worst case is summed up
_STEPS, _LONGEST = 4001, 40.0
_LEAST = 1e-9  # of the pace that trickles


@dataclass(frozen=True)
class WaitingPace:
    """How fast a reference may go that can be stopped within a time, whatever has been before.

    The pace ``z_1`` of a motion follows what is asked for, ``0 <= w <= 1``, through r lags,
    ``(d/dt / omega + 1)^r z_1 = w``, see :class:`~pfsc_drake.control.law.timed_reference.
    TimedReference`. If nothing more is asked for it falls from 1 at worst as

        Q(x) = e^{-x} sum_{k < r} x^k / k!,    x = omega t,

    and the own time ``s`` of the motion comes to rest at ``rest = s + (z_1 + .. + z_r) / omega``,
    ``z_k`` being the outputs of the lags. It follows ``rest' = w``: where the motion would stop
    moves exactly at the pace that is asked for.

    Be b the time until something may be in the way at a place that the motion has not passed yet.
    The pace that is permitted there is

        W(b) = min(1, p / Q(omega b)),    0 if b <= 0.

    If b falls no faster than time goes on, and w <= W(b) for all places between ``s`` and
    ``rest``, then a place is passed at ``z_1 <= resting`` at most where its b is used up. The
    worst of all histories: w = 1 until ``rest`` enters the place at ``x = X``, then W. By what the
    lags still hold, and since ``z_1 <= omega (rest - s)``,

        z_1 <= min(Q(X) + int_0^X h W dx,  int_0^X W dx),    h = -Q',

    and p is the largest number by which no X makes that more than ``resting``.

    Attributes:
        order: r, 1 to 4 for the laws of this project.
        bandwidth: omega [1/s].
        resting: Share of the planned pace that counts as rest.

    Raises:
        InputError: If the bandwidth is not positive, or nothing or all counts as rest.
    """

    order: int
    bandwidth: float
    resting: float

    def __post_init__(self) -> None:
        require_positive("bandwidth", self.bandwidth)
        require_between("resting", self.resting, 1e-4, 0.5, "of the planned pace")

    @cached_property
    def trickle(self) -> float:
        """``p``, the pace that is permitted where all of the time is used up."""

        def excess(log_p: float) -> float:
            return self._largest_left(math.exp(log_p)) - self.resting

        return math.exp(brentq(excess, math.log(_LEAST), math.log(self.resting), xtol=1e-6))

    def _largest_left(self, trickle: float) -> float:
        """Return the largest pace at a place where it should rest, in the worst case."""
        x, step = np.linspace(0.0, _LONGEST, _STEPS, retstep=True)
        left = gammaincc(self.order, x)
        permitted = np.minimum(1.0, trickle / np.maximum(left, np.finfo(float).tiny))
        # from above: the larger end of each step
        asked = np.concatenate([[0.0], np.cumsum(permitted[1:] * step)])
        held = np.concatenate([[0.0], np.cumsum(permitted[1:] * -np.diff(left))])
        return float(np.minimum(left + held, asked).max())

    @property
    def time_to_stop(self) -> float:
        """Time from any pace until it rests, if nothing more is asked for [s]."""
        return float(gammainccinv(self.order, self.resting)) / self.bandwidth

    @property
    def time_unhindered(self) -> float:
        """Time b from which on the pace is not held back at all [s]."""
        return float(gammainccinv(self.order, self.trickle)) / self.bandwidth

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

    def permitted(self, time: Any) -> Any:
        """Return ``W``, the pace that may be asked for.

        Args:
            time: b [s], number or expression.
        """
        within = ca.fmin(ca.fmax(time, 0.0), 2.0 * self.time_unhindered)
        return where(time > 0.0, ca.fmin(self.trickle / self.left(within), 1.0), 0.0)

    def rest(self, s: Any, rates: list[Any]) -> Any:
        """Return where the own time comes to rest if nothing more is asked for [s].

        Args:
            s: The own time [s].
            rates: ``z_1`` and its derivatives 1 to r - 1.
        """
        # z_{k+1} = z_k + z_k' / omega
        lags, total = list(rates), rates[0]
        for _ in range(self.order - 1):
            lags = [a + b / self.bandwidth for a, b in itertools.pairwise(lags)]
            total = total + lags[0]
        return s + total / self.bandwidth

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
