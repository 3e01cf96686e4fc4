"""A sensor that stops working, to see what a controller makes of it."""

from typing import Literal

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.errors import InputError

FailureKind = Literal["nan", "frozen", "jump"]
KINDS = ("nan", "frozen", "jump")


class SensorFailure(LeafSystem):
    """Passes a measurement through until some of its components fail.

    Ports:
        measured (input): Any vector, shape (size,).
        delivered (output): The same; from ``time`` on, the failing components are NaN, rest
            at what they were at the last tick before, or are off by ``jump``.

    State:
        Discrete: the measurement of the last tick before the failure, shape (size,).

    Args:
        size: Size of the measurement.
        indices: Components that fail.
        time: When they fail [s].
        period: Of the ticks [s].
        kind: How: ``nan``, ``frozen`` or ``jump``.
        jump: By how much a jumping one is off.

    Raises:
        InputError: If the kind is not known.
    """

    def __init__(
        self,
        size: int,
        indices: list[int],
        time: float,
        period: float,
        kind: str = "nan",
        jump: float = 0.0,
    ) -> None:
        super().__init__()
        if kind not in KINDS:
            raise InputError(f"kind of a sensor's failure: {kind!r}; must be {', '.join(KINDS)}")
        self._indices, self._time, self._kind, self._jump = indices, time, kind, jump
        self.DeclareDiscreteState(size)
        self._measured = self.DeclareVectorInputPort("measured", size)
        self.DeclareVectorOutputPort("delivered", size, self._calc_delivered)
        if kind == "frozen":
            self.DeclareInitializationDiscreteUpdateEvent(self._start)
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._remember)

    def _calc_delivered(self, context: Context, output: BasicVector) -> None:
        value = self._measured.Eval(context).copy()
        if context.get_time() >= self._time:
            if self._kind == "nan":
                value[self._indices] = np.nan
            elif self._kind == "jump":
                value[self._indices] += self._jump
            else:
                rest = context.get_discrete_state_vector().value()
                value[self._indices] = rest[self._indices]
        output.SetFromVector(value)

    def _start(self, context: Context, state: DiscreteValues) -> EventStatus:
        state.set_value(self._measured.Eval(context))
        return EventStatus.Succeeded()

    def _remember(self, context: Context, state: DiscreteValues) -> None:
        if context.get_time() < self._time:
            state.set_value(self._measured.Eval(context))
