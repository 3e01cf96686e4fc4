"""A channel between two places: what is told arrives later, unevenly, or not at all."""

from dataclasses import dataclass
from typing import Annotated, Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.yaml.rules import Parameters, Range, Seed

# ticks after which the draws of delays and losses begin again
_DRAWN = 8192
_LONGEST, _MOST_LOST = 2.0, 0.9


@dataclass
class ChannelParameters(Parameters):
    """What a channel does to messages, one way; in whole ticks, one at least.

    Attributes:
        delay: Least delay [s].
        jitter: How much longer a message may take [s]; each its own, evenly spread, so that some
            overtake others.
        loss: Share of the messages that never arrive.
        seed: Another one draws others.
    """

    delay: Annotated[float, Range(0.0, _LONGEST, "s")] = 0.1
    jitter: Annotated[float, Range(0.0, _LONGEST, "s")] = 0.0
    loss: Annotated[float, Range(0.0, _MOST_LOST)] = 0.0
    seed: Seed = 0


def message_ages(parameters: ChannelParameters, period: float) -> np.ndarray:
    """Return how old the newest message is that has arrived, at each tick, shape (ticks,).

    In ticks, 1 at least; it repeats, as what is drawn does.

    Args:
        parameters: The channel.
        period: Sampling time [s].
    """
    random = np.random.default_rng(parameters.seed)
    least, spread = round(parameters.delay / period), round(parameters.jitter / period)
    delays = np.maximum(1, least + random.integers(0, spread, _DRAWN, endpoint=True))
    arrives = random.uniform(size=_DRAWN) >= parameters.loss
    # the second round, in which there is a past
    newest = np.full(2 * _DRAWN, -1)
    for sent in np.flatnonzero(np.tile(arrives, 2)):
        at = sent + delays[sent % _DRAWN]
        if at < 2 * _DRAWN:
            newest[at] = max(newest[at], sent)
    newest = np.maximum.accumulate(newest)
    return np.arange(_DRAWN, 2 * _DRAWN) - newest[_DRAWN:]


class Channel(Block):
    """Delivers the newest message that has arrived.

    Messages say what they are by themselves, so that one that was overtaken is of no use.

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
        """Return what is remembered at the next tick; what is left out stays."""
        return {"under_way": ca.vertcat(u.sent, x.under_way)[: self._size * self._oldest]}
