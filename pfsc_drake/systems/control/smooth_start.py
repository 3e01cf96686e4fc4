"""A reference that starts where the tool is."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.control.law.transition import Transition


class SmoothStart(LeafSystem):
    """Lets a reference start where the tool is, and go over to the wanted one, see Transition.

    Ports:
        desired_reference (input): Derivatives 0..order of the wanted reference by rows, shape
            ((order + 1) m,).
        manifold_state (input): Derivatives 0.. of the virtual output by rows, m each, which is
            read at initialization only.
        reference (output): Derivatives 0..order of the reference, shape ((order + 1) m,).

    State:
        Discrete: distance of the tool from the wanted reference at the start, shape (m,), and
        when that was [s], shape (1,). A tool that is nowhere has no distance.

    Args:
        duration: How long the transition takes [s].
        order: Highest derivative.
        num_outputs: ``m``.
        state_size: Of ``manifold_state``.

    Raises:
        InputError: If duration or order are out of range.
    """

    def __init__(self, duration: float, order: int, num_outputs: int, state_size: int) -> None:
        super().__init__()
        self._transition, self._m = Transition(duration, order), num_outputs
        size = (order + 1) * num_outputs
        memory = self.DeclareDiscreteState(num_outputs + 1)
        self._desired = self.DeclareVectorInputPort("desired_reference", size)
        self._actual = self.DeclareVectorInputPort("manifold_state", state_size)
        self.DeclareVectorOutputPort(
            "reference",
            size,
            self._calc_reference,
            prerequisites_of_calc={
                self._desired.ticket(),
                self.discrete_state_ticket(memory),
                self.time_ticket(),
            },
        )
        self.DeclareInitializationDiscreteUpdateEvent(self._start)

    def _calc_reference(self, context: Context, output: BasicVector) -> None:
        memory = context.get_discrete_state_vector().value()
        desired, elapsed = self._desired.Eval(context), context.get_time() - memory[-1]
        if elapsed < self._transition.duration:
            rest = np.outer(self._transition.at(elapsed), memory[:-1]).ravel()
            desired = desired + rest
        output.SetFromVector(desired)

    def _start(self, context: Context, state: DiscreteValues) -> EventStatus:
        actual = self._actual.Eval(context)[: self._m]
        distance = actual - self._desired.Eval(context)[: self._m]
        distance[~np.isfinite(distance)] = 0.0
        state.set_value(np.append(distance, context.get_time()))
        return EventStatus.Succeeded()
