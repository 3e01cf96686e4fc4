"""What a person has drawn, sent again as fast as it is taken."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem


class RecordedPen(LeafSystem):
    """Messages of a drawing, each at its time, or later where there is no room for it before.

    A message holds the last ``length`` way points: a further one is sent only when the first of
    them has been taken, as a live session does it.

    Ports:
        stream (input): See :class:`~pfsc_drake.control.streams.intake.WaypointIntake`, shape (4,).
        controls (output): The message, shape (size,).

    Args:
        ticks: When messages change, in sampling intervals, not decreasing, shape (rows,).
        messages: What they become, each by at most one way point more, shape (rows, size).
        length: How many way points a message holds.
        period: Sampling time [s].
    """

    def __init__(self, ticks: np.ndarray, messages: np.ndarray, length: int, period: float) -> None:
        super().__init__()
        self._ticks, self._messages, self._length = ticks, messages, length
        self._totals, self._period = messages[:, 0], period
        self._stream = self.DeclareVectorInputPort("stream", 4)
        self.DeclareVectorOutputPort(
            "controls",
            messages.shape[1],
            self._calc_message,
            prerequisites_of_calc={self.time_ticket(), self._stream.ticket()},
        )

    def _calc_message(self, context: Context, output: BasicVector) -> None:
        tick = round(context.get_time() / self._period)
        room = self._stream.Eval(context)[1] + self._length
        come = np.searchsorted(self._ticks, tick, side="right")
        fitting = np.searchsorted(self._totals, room, side="right")
        output.SetFromVector(self._messages[max(min(come, fitting) - 1, 0)])
