"""Settings of an operator while a robot moves: live, or recorded."""

from collections.abc import Mapping

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem


class OperatorPanel(LeafSystem):
    """Samples an operator's controls once per period.

    The controls come from a live session, which fixes their values, or from
    :class:`RecordedControls`. Only their values at the ticks have an effect, so that a recording of
    them repeats a run to the last bit.

    Ports:
        controls (input, optional): All parts, one after the other, shape (size,); while it is
            neither connected nor fixed, all parts keep their initial values.
        NAME (output): One per part.

    State:
        Discrete: the controls at the last tick, shape (size,).

    Args:
        parts: Initial values of the parts, by name, 1-dimensional.
        period: Sampling time [s].
    """

    def __init__(self, parts: Mapping[str, np.ndarray], period: float) -> None:
        super().__init__()
        initial = np.concatenate(list(parts.values()))
        memory = self.discrete_state_ticket(self.DeclareDiscreteState(initial))
        self._controls = self.DeclareVectorInputPort("controls", len(initial))
        begin = 0
        for name, values in parts.items():
            self._add_output(name, slice(begin, begin + len(values)), memory)
            begin += len(values)
        self.period = period
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._sample)

    def _add_output(self, name: str, part: slice, memory: object) -> None:
        def calc(context: Context, output: BasicVector) -> None:
            output.SetFromVector(context.get_discrete_state_vector().value()[part])

        self.DeclareVectorOutputPort(
            name, part.stop - part.start, calc, prerequisites_of_calc={memory}
        )

    def _sample(self, context: Context, state: DiscreteValues) -> None:
        if self._controls.HasValue(context):
            state.set_value(self._controls.Eval(context))


class RecordedControls(LeafSystem):
    """Recorded controls, held from one change to the next.

    Ports:
        controls (output): The last row whose tick has come, before it the first row, shape (size,).

    Args:
        ticks: Ticks of the changes, in sampling intervals, increasing, shape (rows,).
        rows: Values from these ticks on, shape (rows, size).
        period: Sampling interval [s].
    """

    def __init__(self, ticks: np.ndarray, rows: np.ndarray, period: float) -> None:
        super().__init__()
        self._ticks, self._rows, self._period = ticks, rows, period
        self.DeclareVectorOutputPort(
            "controls",
            rows.shape[1],
            self._calc_controls,
            prerequisites_of_calc={self.time_ticket()},
        )

    def _calc_controls(self, context: Context, output: BasicVector) -> None:
        tick = round(context.get_time() / self._period)
        row = max(int(np.searchsorted(self._ticks, tick, side="right")) - 1, 0)
        output.SetFromVector(self._rows[row])


class RecordedPen(LeafSystem):
    """Messages of a recorded drawing, each at its time, or later if there was no space before.

    A message holds the last ``length`` waypoints: a further one is sent only after the first of
    them has been taken, as in a live session.

    Ports:
        stream (input): See :class:`~pfsc_drake.control.streams.intake.WaypointIntake`, shape (4,).
        controls (output): The message, shape (size,).

    Args:
        ticks: Ticks of the changes, in sampling intervals, not decreasing, shape (rows,).
        messages: Messages from these ticks on, each with at most one waypoint more, shape (rows,
            size).
        length: Number of waypoints in a message.
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
        last = self._stream.Eval(context)[1] + self._length
        come = np.searchsorted(self._ticks, tick, side="right")
        fitting = np.searchsorted(self._totals, last, side="right")
        output.SetFromVector(self._messages[max(min(come, fitting) - 1, 0)])
