"""A start without a jump: the reference starts where the tool is and goes over to its own."""

from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.errors import InputError

# from 0 to 1 on a unit interval with four derivatives that vanish at both ends, so that the
# reference of the elastic law, which needs four (3.67), is steady
_STEP = np.polynomial.Polynomial([0.0, 0.0, 0.0, 0.0, 0.0, 126.0, -420.0, 540.0, -315.0, 70.0])
_HIGHEST_ORDER = 4


class Transition:
    """What is left of the distance at the start, ``s(t)``, from 1 to 0 with derivatives.

    A reference ``y_d(t) + s(t) (y(0) - y_d(0))`` starts where ``y(0)`` is, at rest if ``y_d`` is,
    and is ``y_d`` from ``duration`` on.

    Args:
        duration: How long it takes [s].
        order: Highest derivative that is needed, at most 4.

    Attributes:
        duration: How long it takes [s].
        order: Highest derivative.

    Raises:
        InputError: If the duration is not positive or the order too high.
    """

    def __init__(self, duration: float, order: int) -> None:
        if not (np.isfinite(duration) and duration > 0.0):
            raise InputError(f"transition: {duration} s; must be a positive number")
        if not 0 <= order <= _HIGHEST_ORDER:
            raise InputError(f"transition: order {order}; must be 0 to {_HIGHEST_ORDER}")
        self.duration, self.order = duration, order
        rest = 1.0 - _STEP
        # row k holds the coefficients of the k-th derivative, in real time
        self._coefficients = np.zeros((order + 1, rest.coef.size))
        for k in range(order + 1):
            derivative = np.asarray((rest.deriv(k) if k else rest).coef, dtype=float)
            self._coefficients[k, : derivative.size] = derivative / duration**k

    def at(self, time: Any) -> Any:
        """Return ``s`` and its derivatives, shape (order + 1,) [1, 1/s, ..].

        Args:
            time: Since the start [s], number or expression; earlier is the start, later than the
                duration its end.
        """
        x = ca.fmin(ca.fmax(time / self.duration, 0.0), 1.0)
        s = ca.DM.zeros(self.order + 1)
        for coefficients in reversed(self._coefficients.T):
            s = s * x + ca.DM(coefficients)
        return s
