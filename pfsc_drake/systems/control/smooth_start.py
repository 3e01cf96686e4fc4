"""A reference that starts where the tool is."""

import casadi as ca
import numpy as np
from pydrake.systems.framework import (
    Context,
    Diagram,
    DiagramBuilder,
    DiscreteValues,
    EventStatus,
    LeafSystem,
)
from pydrake.systems.primitives import Adder

from pfsc_drake.compiled.plain_function import PlainFunction
from pfsc_drake.control.law.transition import Transition


class SmoothStart(Diagram):
    """Lets a reference start where the tool is, and go over to the wanted one, see Transition.

    What is added to the wanted reference is worked out a tick ahead, so that it takes no time
    between measurement and drives; it is held until the next tick.

    Ports:
        desired_reference (input): Derivatives 0..order of the wanted reference by rows, shape
            ((order + 1) m,).
        manifold_state (input): Derivatives 0.. of the virtual output by rows, m each, which is
            read at initialization only.
        reference (output): Derivatives 0..order of the reference, shape ((order + 1) m,).

    Args:
        duration: How long the transition takes [s].
        order: Highest derivative.
        num_outputs: ``m``.
        state_size: Of ``manifold_state``.
        period: Sampling time of what reads the reference [s].

    Raises:
        InputError: If duration or order are out of range.
    """

    def __init__(
        self, duration: float, order: int, num_outputs: int, state_size: int, period: float
    ) -> None:
        super().__init__()
        builder = DiagramBuilder()
        transition = Transition(duration, order)
        rest = builder.AddNamedSystem(
            "distance", _Distance(transition, num_outputs, state_size, period)
        )
        total = builder.AddNamedSystem("sum", Adder(2, rest.get_output_port().size()))
        builder.ExportInput(rest.GetInputPort("manifold_state"), "manifold_state")
        desired = builder.ExportInput(rest.GetInputPort("desired_reference"), "desired_reference")
        builder.ConnectInput(desired, total.get_input_port(0))
        builder.Connect(rest.get_output_port(), total.get_input_port(1))
        builder.ExportOutput(total.get_output_port(), "reference")
        builder.BuildInto(self)


class _Distance(LeafSystem):
    """What is left of the distance between the wanted reference and the tool at the start.

    Ports:
        desired_reference, manifold_state (input): See :class:`SmoothStart`; both are read at
            initialization only.
        distance (output): Derivatives 0..order by rows, shape ((order + 1) m,).

    State:
        Discrete: what is left at the next tick, which is the output; and in a second group
        distance at the start, shape (m,), and when that was [s], shape (1,). A tool that is
        nowhere has no distance.
    """

    def __init__(
        self, transition: Transition, num_outputs: int, state_size: int, period: float
    ) -> None:
        super().__init__()
        self._m, self._period, self._duration = num_outputs, period, transition.duration
        elapsed = ca.SX.sym("elapsed")
        self._rest = PlainFunction(ca.Function("rest", [elapsed], [transition.at(elapsed)]))
        size = (transition.order + 1) * num_outputs
        self._left = self.DeclareDiscreteState(size)
        self._start = self.DeclareDiscreteState(num_outputs + 1)
        self._desired = self.DeclareVectorInputPort("desired_reference", size)
        self._actual = self.DeclareVectorInputPort("manifold_state", state_size)
        self.DeclareStateOutputPort("distance", self._left)
        self.DeclareInitializationDiscreteUpdateEvent(self._begin)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._look_ahead)

    def _begin(self, context: Context, state: DiscreteValues) -> EventStatus:
        actual = self._actual.Eval(context)[: self._m]
        distance = actual - self._desired.Eval(context)[: self._m]
        distance[~np.isfinite(distance)] = 0.0
        state.set_value(self._start, np.append(distance, context.get_time()))
        state.set_value(self._left, self._left_at(0.0, distance))
        return EventStatus.Succeeded()

    def _look_ahead(self, context: Context, state: DiscreteValues) -> None:
        start = context.get_discrete_state(self._start).value()
        # a product as in Drake's own schedule, so that it is the time of the tick to the last bit
        tick = (round(context.get_time() / self._period) + 1) * self._period
        elapsed = tick - start.item(self._m)
        if elapsed < self._duration:
            state.set_value(self._left, self._left_at(elapsed, start[:-1]))
        else:
            state.get_mutable_value(self._left).fill(0.0)

    def _left_at(self, elapsed: float, distance: np.ndarray) -> np.ndarray:
        return np.outer(self._rest(elapsed), distance).ravel()
