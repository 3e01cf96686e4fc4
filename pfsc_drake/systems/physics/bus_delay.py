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

    Ports:
        sent (input): Any vector, shape (size,).
        delivered (output): The same, later, shape (size,); no direct feedthrough.

    State:
        Discrete: the last k + 1 samples, newest first, shape ((k + 1) size,); whether the
        first tick is still to come, shape (1,).

    Args:
        size: Size of the vector.
        delay: Delay [s], a whole number k of periods, 1 to MAX_PERIODS.
        period: Sampling time T of the bus [s].

    Raises:
        InputError: If the delay is not a positive multiple of the period.
    """

    def __init__(self, size: int, delay: float, period: float) -> None:
        super().__init__()
        self.num_samples = _whole_periods(delay, period)
        self._size = size
        samples = self.DeclareDiscreteState(size * (self.num_samples + 1))
        self._starting = self.DeclareDiscreteState(np.ones(1))
        self._samples = samples
        self._sent = self.DeclareVectorInputPort("sent", size)
        self.DeclareVectorOutputPort(
            "delivered",
            size,
            self._calc_delivered,
            prerequisites_of_calc={self.discrete_state_ticket(samples)},
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
        shifted = np.concatenate([self._sent.Eval(context), samples[: -self._size]])
        discrete.set_value(self._samples, shifted)

    def _calc_delivered(self, context: Context, output: BasicVector) -> None:
        samples = context.get_discrete_state(self._samples).value()
        output.SetFromVector(samples[-self._size :])


def add_bus_delay(
    builder: DiagramBuilder, port: OutputPort, delay: float, period: float, name: str = "bus_delay"
) -> BusDelay:
    """Add a bus behind an output port.

    Args:
        builder: Builder of the diagram.
        port: What is sent.
        delay: Delay [s], a positive multiple of the period.
        period: Sampling time of the bus [s].
        name: Name of the system.

    Returns:
        The bus; its output port is ``delivered``.

    Raises:
        InputError: If the delay is not a positive multiple of the period.
    """
    bus = builder.AddNamedSystem(name, BusDelay(port.size(), delay, period))
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
