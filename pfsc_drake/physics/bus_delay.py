"""A field bus that delivers its samples late."""

from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_of, is_finite, where
from pfsc_drake.errors import InputError

MAX_PERIODS = 10_000  # in a delay; every sample of it is moved at every tick
# how far the number of periods in a delay may be from a whole number
_ROUNDING = 1e-6


class BusDelay(Block):
    """Samples a vector and delivers each sample a whole number of periods later.

    ``delivered(t) = sent((j - k) T)`` for ``j T <= t < (j + 1) T``, ``k = delay / T``: exact for
    readers between the ticks as well as for those at the ticks. Before ``t = k T`` it delivers
    what was sent at the start, not zero, so that nothing jumps.

    A frame that is sent while the bus loses its frames does not arrive: what was delivered
    last is delivered on, and the silence is counted.

    Ports:
        sent (input): Any vector, shape (size,).
        delivered (output): The same, later, shape (size,); no direct feedthrough.
        silence (output): Since when nothing has arrived, beyond the period [s], shape (1,).

    State:
        The last k + 1 ``samples``, newest first, shape ((k + 1) size,), where one is lost
        the one before it again; how old in periods each of them is beyond its delay (``ages``);
        the last ``tick``, infinite before the first, which takes what is sent then for all that
        was sent before.

    Args:
        size: Size of the vector.
        delay: Delay [s], a whole number k of periods, 1 to MAX_PERIODS.
        period: Sampling time T of the bus [s].
        lost: From when to when it loses its frames [s]; none if it ends before it begins.

    Raises:
        InputError: If the delay is not a positive multiple of the period.
    """

    expands = False  # long vectors are moved

    def __init__(
        self, size: int, delay: float, period: float, lost: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        self.num_samples = _whole_periods(delay, period)
        self._size, self._period, self._lost = size, period, lost
        count = self.num_samples + 1
        self.inputs = {"sent": Port(size)}
        self.outputs = {"delivered": Port(size), "silence": Port(1, "s")}
        self.states = {"samples": size * count, "ages": count, "tick": 1}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        return {"samples": self._everywhere(u), "tick": np.inf}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        n, moves = self._size, t > x.tick + 0.5  # what is sent at this tick is not among them yet
        oldest, before = x.samples[-n:], x.samples[-2 * n : -n]
        age = where(moves, x.ages[-2], x.ages[-1])
        return {"delivered": where(moves, before, oldest), "silence": self._period * age}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        time, (begin, end) = t * self._period, self._lost
        lost, has_begun = all_of(time >= begin, time < end), is_finite(x.tick)
        newest = where(lost, x.samples[: self._size], u.sent)
        samples = ca.vertcat(newest, x.samples[: -self._size])
        ages = ca.vertcat(where(lost, x.ages[0] + 1.0, 0.0), x.ages[:-1])
        return {
            "samples": where(has_begun, samples, self._everywhere(u)),
            "ages": where(has_begun, ages, x.ages),
            "tick": t,
        }

    def _everywhere(self, u: Values) -> Any:
        return ca.repmat(u.sent, self.num_samples + 1, 1)


def _whole_periods(delay: float, period: float) -> int:
    if not 0.0 < period < np.inf:
        raise InputError(f"bus: period = {period!r} s; must be positive and finite")
    ratio = delay / period
    if not 0.5 < ratio < MAX_PERIODS + 0.5 or abs(ratio - round(ratio)) > _ROUNDING:
        raise InputError(
            f"bus: delay = {delay!r} s; must be a positive multiple of the period {period!r} s, "
            f"up to {MAX_PERIODS * period:g} s"
        )
    return round(ratio)
