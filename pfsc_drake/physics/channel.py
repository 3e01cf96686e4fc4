"""Communication channel with delay, jitter and loss of messages."""

from dataclasses import dataclass
from typing import Annotated, Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.yaml.rules import Parameters, Range, Seed

# ticks after which random delays and losses repeat
_DRAWN = 8192
_LONGEST, _MOST_LOST = 2.0, 0.9


@dataclass
class ChannelParameters(Parameters):
    """Parameters of a channel in one direction; delays are rounded to whole ticks, at least one.

    Attributes:
        delay: Least delay [s].
        jitter: Largest additional delay of a message [s], uniformly distributed and independent, so
            that messages may overtake others.
        loss: Share of the messages that never arrive.
        seed: Seed of the random delays and losses.
    """

    delay: Annotated[float, Range(0.0, _LONGEST, "s")] = 0.1
    jitter: Annotated[float, Range(0.0, _LONGEST, "s")] = 0.0
    loss: Annotated[float, Range(0.0, _MOST_LOST)] = 0.0
    seed: Seed = 0


def message_ages(parameters: ChannelParameters, period: float) -> np.ndarray:
    """Return the age of the newest arrived message at each tick, shape (ticks,).

    The age is in ticks, at least 1; the sequence is periodic, as the random numbers are.

    Args:
        parameters: The channel.
        period: Sampling time [s].
    """
    random = np.random.default_rng(parameters.seed)
    least, spread = round(parameters.delay / period), round(parameters.jitter / period)
    delays = np.maximum(1, least + random.integers(0, spread, _DRAWN, endpoint=True))
    arrives = random.uniform(size=_DRAWN) >= parameters.loss
    # the second period, which has a past
    newest = np.full(2 * _DRAWN, -1)
    for sent in np.flatnonzero(np.tile(arrives, 2)):
        at = sent + delays[sent % _DRAWN]
        if at < 2 * _DRAWN:
            newest[at] = max(newest[at], sent)
    newest = np.maximum.accumulate(newest)
    return np.arange(_DRAWN, 2 * _DRAWN) - newest[_DRAWN:]


class Channel(Block):
    """Delivers the newest message that has arrived.

    Messages are self-contained, so that overtaken ones are discarded.

    Ports:
        sent (input): The message of this tick, shape (size,).
        arrived (output): The newest one that has arrived, shape (size,); zero before the first.

    State:
        under_way: The last messages, latest first, shape (size k,).

    Args:
        parameters: The channel.
        size: Size of a message.
        period: Sampling time [s].
    """

    expands = False  # a table

    def __init__(self, parameters: ChannelParameters, size: int, period: float) -> None:
        ages = message_ages(parameters, period)
        self._size, self._oldest, self._ages = size, int(ages.max()), ca.DM(ages.tolist())
        self.inputs, self.outputs = {"sent": Port(size)}, {"arrived": Port(size)}
        self.states = {"under_way": size * self._oldest}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        age = ca.MX(self._ages)[ca.fmod(t, _DRAWN)]
        messages = ca.reshape(ca.MX(x.under_way), self._size, self._oldest)
        return {"arrived": messages[:, age - 1]}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the states at the next tick; omitted ones keep their values."""
        return {"under_way": ca.vertcat(u.sent, x.under_way)[: self._size * self._oldest]}
