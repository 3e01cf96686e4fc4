"""A field bus that delivers its samples late."""

import numpy as np
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiagramBuilder,
    EventStatus,
    LeafSystem,
    OutputPort,
    State,
)

from pfsc_drake.errors import InputError

MAX_PERIODS = 10_000  # in a delay; every sample of it is moved at every tick
# how far the number of periods in a delay may be from a whole number
_ROUNDING = 1e-6


class BusDelay(LeafSystem):
    """Samples a vector and delivers each sample a whole number of periods later.

    ``delivered(t) = sent((j - k) T)`` for ``j T <= t < (j + 1) T``, ``k = delay / T``: exact for
    readers between the ticks as well as for discrete updates at the ticks. Before
    ``t = k T`` it delivers what was sent at the start, not zero, so that nothing jumps.

    The samples move in an unrestricted update, which comes before the discrete updates of
    the same tick. Readers that are themselves unrestricted updates see the tick before, so
    that two delays in a row add one period of their own; use one delay for the sum.

    A frame that is sent while the bus loses its frames does not arrive: what was delivered
    last is delivered on, and the silence is counted.

    Ports:
        sent (input): Any vector, shape (size,).
        delivered (output): The same, later, shape (size,); no direct feedthrough.
        silence (output): Since when nothing has arrived, beyond the period [s], shape (1,).

    State:
        Discrete: the last k + 1 samples, newest first, shape ((k + 1) size,), where one is lost
        the one before it again; whether the first tick is still to come, shape (1,); how old
        in periods each of the samples is beyond its delay, shape (k + 1,).

    Args:
        size: Size of the vector.
        delay: Delay [s], a whole number k of periods, 1 to MAX_PERIODS.
        period: Sampling time T of the bus [s].
        lost: From when to when it loses its frames [s]; none if it ends before it begins.

    Raises:
        InputError: If the delay is not a positive multiple of the period.
    """

    def __init__(
        self, size: int, delay: float, period: float, lost: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        super().__init__()
        self.num_samples = _whole_periods(delay, period)
        self._size, self._period, self._lost = size, period, lost
        samples = self.DeclareDiscreteState(size * (self.num_samples + 1))
        self._starting = self.DeclareDiscreteState(np.ones(1))
        self._samples = samples
        self._ages = self.DeclareDiscreteState(self.num_samples + 1)
        self._sent = self.DeclareVectorInputPort("sent", size)
        self.DeclareVectorOutputPort(
            "delivered",
            size,
            self._calc_delivered,
            prerequisites_of_calc={self.discrete_state_ticket(samples)},
        )
        self.DeclareVectorOutputPort(
            "silence",
            1,
            self._calc_silence,
            prerequisites_of_calc={self.discrete_state_ticket(self._ages)},
        )
        self.DeclareInitializationUnrestrictedUpdateEvent(self._fill)
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._shift)

    def _fill(self, context: Context, state: State) -> EventStatus:
        discrete = state.get_mutable_discrete_state()
        everywhere = np.tile(self._sent.Eval(context), self.num_samples + 1)
        discrete.set_value(self._samples, everywhere)
        discrete.set_value(self._starting, [1.0])
        return EventStatus.Succeeded()

    def _shift(self, context: Context, state: State) -> None:
        discrete = state.get_mutable_discrete_state()
        if context.get_discrete_state(self._starting)[0]:
            # what is sent may have changed while other systems were initialized
            self._fill(context, state)
            discrete.set_value(self._starting, [0.0])
            return
        samples = context.get_discrete_state(self._samples).value()
        ages = context.get_discrete_state(self._ages).value()
        begin, end = self._lost
        lost = begin <= context.get_time() < end
        newest = samples[: self._size] if lost else self._sent.Eval(context)
        age = ages[0] + 1.0 if lost else 0.0
        discrete.set_value(self._samples, np.concatenate([newest, samples[: -self._size]]))
        discrete.set_value(self._ages, np.concatenate([[age], ages[:-1]]))

    def _calc_delivered(self, context: Context, output: BasicVector) -> None:
        samples = context.get_discrete_state(self._samples).value()
        output.SetFromVector(samples[-self._size :])

    def _calc_silence(self, context: Context, output: BasicVector) -> None:
        ages = context.get_discrete_state(self._ages).value()
        output.SetFromVector([self._period * ages[-1]])


def add_bus_delay(
    builder: DiagramBuilder,
    port: OutputPort,
    delay: float,
    period: float,
    name: str = "bus_delay",
    lost: tuple[float, float] = (0.0, 0.0),
) -> BusDelay:
    """Add a bus behind an output port.

    Args:
        builder: Builder of the diagram.
        port: What is sent.
        delay: Delay [s], a positive multiple of the period.
        period: Sampling time of the bus [s].
        name: Name of the system.
        lost: From when to when it loses its frames [s].

    Returns:
        The bus; its output port is ``delivered``.

    Raises:
        InputError: If the delay is not a positive multiple of the period.
    """
    bus = builder.AddNamedSystem(name, BusDelay(port.size(), delay, period, lost))
    builder.Connect(port, bus.GetInputPort("sent"))
    return bus


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
