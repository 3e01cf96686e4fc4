"""A person's wishes for the impedance, as far as they may be granted now."""

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.control.compliance.tuned_impedance import WISHES, ImpedanceTuning


class ImpedanceTuner(LeafSystem):
    """Gives an impedance filter its parameters, see :class:`ImpedanceTuning`.

    The impedance follows at once from state and inputs, so that the deflection at which a spring
    becomes stiffer is the one that is paid for. The filter's reference does not depend on it, and
    there is no algebraic loop.

    Ports:
        wish (input): Stiffness and damping, tangential, transversal and rotational, shape (6,);
            what is negative stays as given.
        manifold_state (input): Derivatives of yhat by rows, where parameters depend on it.
        reference (input): Derivatives of y_p by rows, from :class:`ImpedanceFilter`.
        desired_reference (input): Derivatives of y_d by rows.
        impedance (output): Rows mass, damping, stiffness, shape (3 m,), from this tick on.
        tank (output): Energy that stiffening springs may take [J], shape (1,).

    State:
        Discrete: impedance by rows, rates ``e'`` and tank after the last tick, shape (4 m + 1,).

    Args:
        tuning: How wishes are followed.
        given: The impedance without wishes: function of yhat (m,), rows as above, shape (3, m).
        sizes: Of ``manifold_state``, ``reference`` and ``desired_reference``.
        period: Sampling time [s].
    """

    def __init__(
        self,
        tuning: ImpedanceTuning,
        given: Callable[[np.ndarray], np.ndarray],
        sizes: tuple[int, int, int],
        period: float,
    ) -> None:
        super().__init__()
        self._tuning, self._given, m = tuning, given, tuning.num_outputs
        self._m = m
        initial = tuning.start(given(np.zeros(m)))
        memory = self.discrete_state_ticket(self.DeclareDiscreteState(initial))
        self._wish = self.DeclareVectorInputPort("wish", WISHES)
        names = ("manifold_state", "reference", "desired_reference")
        self._state, self._reference, self._desired = (
            self.DeclareVectorInputPort(name, size) for name, size in zip(names, sizes, strict=True)
        )
        inputs = (self._wish, self._state, self._reference, self._desired)
        sources = {memory, *(port.ticket() for port in inputs)}
        self._next = self.DeclareVectorOutputPort(
            "next", 4 * m + 1, self._calc_next, prerequisites_of_calc=sources
        )
        self.DeclareVectorOutputPort(
            "impedance", 3 * m, self._calc_impedance, prerequisites_of_calc=sources
        )
        self.DeclareVectorOutputPort("tank", 1, self._calc_tank, prerequisites_of_calc={memory})
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _given_now(self, context: Context) -> np.ndarray:
        return self._given(self._state.Eval(context)[: self._m])

    def _calc_next(self, context: Context, output: BasicVector) -> None:
        motion = self._reference.Eval(context)[: 2 * self._m].reshape(2, -1)
        error = motion - self._desired.Eval(context)[: 2 * self._m].reshape(2, -1)
        memory = context.get_discrete_state_vector().value()
        given, wish = self._given_now(context), self._wish.Eval(context)
        output.SetFromVector(self._tuning.advance(memory, given, wish, error))

    def _calc_impedance(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._next.Eval(context)[: 3 * self._m])

    def _calc_tank(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state_vector().value()[-1:])

    def _initialize(self, context: Context, state: DiscreteValues) -> EventStatus:
        state.set_value(self._tuning.start(self._given_now(context)))
        return EventStatus.Succeeded()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._next.Eval(context))
