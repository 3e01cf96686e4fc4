"""Connection to the other side of a teleoperation in another process, in real time."""

import time
from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from pfsc_drake.control.teleoperation.message import MESSAGE
from pfsc_drake.drivers.teleoperation_link import TeleoperationEndpoint

_LATE = 0.1  # s, largest delay that is caught up; after a longer one the clock is shifted


class ChannelEnd(LeafSystem):
    """Exchange of messages with the other side at each tick.

    It waits for the clock, so that a simulation is never ahead of it, unless ``paced`` is false.

    Ports:
        sent (input): Message of this side, shape (15,).
        arrived (output): Newest message of the other side at the last tick, shape (15,); zero
            before the first.

    Args:
        end: End of the link.
        period: Sampling time [s].
        clock: Function that returns the time [s].
        sleep: Function that waits [s].
        paced: Whether it waits for the clock.
    """

    def __init__(
        self,
        end: TeleoperationEndpoint,
        period: float,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
        *,
        paced: bool = True,
    ) -> None:
        super().__init__()
        self._end, self._clock, self._sleep = end, clock, sleep
        self._begin, self._paced = 0.0, paced
        self.DeclareVectorInputPort("sent", MESSAGE)
        state = self.DeclareDiscreteState(MESSAGE)
        self.DeclareStateOutputPort("arrived", state)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._exchange)

    def _exchange(self, context: Context, values: DiscreteValues) -> None:
        now = context.get_time()
        if now == 0.0:
            self._end.begin()
            self._begin = self._clock()
        if self._paced:
            self._wait(now)
        sent: BasicVector = self.GetInputPort("sent").Eval(context)
        self._end.send(np.asarray(sent))
        values.set_value(self._end.newest())

    def _wait(self, now: float) -> None:
        early = self._begin + now - self._clock()
        if early > 0.0:
            self._sleep(early)
        elif early < -_LATE:
            self._begin -= early
