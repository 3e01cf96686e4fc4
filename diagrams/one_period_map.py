"""The map of one sampling period of a whole diagram.

A controlled robot is continuous between its ticks and jumps at them. From right after one tick to
right after the next its state obeys a smooth map as long as nothing switches. The state of this map
is the state of the whole diagram: plant, holds, filters, observers, controller.
"""

from collections.abc import Callable

import numpy as np
from pydrake.systems.analysis import InitializeParams, Simulator
from pydrake.systems.framework import Context, Diagram, System

# s, by which the section lies behind the tick, so that the tick is not repeated
_BEHIND = 1e-9


class OnePeriodMap:
    """A diagram's state right after a tick as a function of its state after the tick before.

    Variables are numbered through: the continuous state, then all discrete states. Abstract states
    keep their values of the section.

    Args:
        diagram: The diagram.
        period: Sampling time [s]; every other one in the diagram is a whole fraction of it.
        configure: Configures the integrator of a simulator.

    Attributes:
        context: Context of the diagram after the last evaluation.
        size: Number of variables.
        num_continuous: Number of continuous ones among them, which stand first.
    """

    def __init__(
        self, diagram: Diagram, period: float, configure: Callable[[Simulator], None]
    ) -> None:
        self.period = period
        self._diagram = diagram
        self._simulator = Simulator(diagram)
        configure(self._simulator)
        self.context = self._simulator.get_mutable_context()
        self._silent = InitializeParams(suppress_initialization_events=True)
        self._groups = range(self.context.num_discrete_state_groups())
        sizes = [self.context.num_continuous_states()]
        sizes += [self.context.get_discrete_state(group).size() for group in self._groups]
        ends = np.cumsum(sizes).tolist()
        self._parts = [slice(end - size, end) for size, end in zip(sizes, ends, strict=True)]
        self.size: int = ends[-1]
        self.num_continuous = sizes[0]

    def rows(self, system: System) -> np.ndarray:
        """Return the indices of a system's continuous and discrete state among the variables.

        Args:
            system: A system of the diagram.
        """
        context = self._diagram.CreateDefaultContext()
        for part in self._parts:
            self._set_part(context, part, np.zeros(part.stop - part.start))
        own = system.GetMyMutableContextFromRoot(context)
        own.SetContinuousState(np.ones(own.num_continuous_states()))
        for group in range(own.num_discrete_state_groups()):
            own.SetDiscreteState(group, np.ones(own.get_discrete_state(group).size()))
        return np.flatnonzero(self.variables(context))

    def variables(self, context: Context) -> np.ndarray:
        """Return all variables of a context, shape (size,)."""
        discrete = [context.get_discrete_state(group).value() for group in self._groups]
        return np.concatenate([context.get_continuous_state_vector().CopyToVector(), *discrete])

    def adopted(self, section: Context) -> Context:
        """Return a section of this diagram with time and variables of another's.

        Args:
            section: Context of a diagram that differs in numbers only.
        """
        context = self._diagram.CreateDefaultContext()
        context.SetTime(section.get_time())
        x = self.variables(section)
        for part in self._parts:
            self._set_part(context, part, x[part])
        return context

    def advance(self, section: Context, x: np.ndarray | None = None) -> np.ndarray:
        """Return the variables right after the next tick, shape (size,).

        Args:
            section: Context right after a tick; unchanged.
            x: Variables in place of its own, shape (size,).
        """
        self.approach(section, x)
        return self.pass_tick()

    def pass_tick(self) -> np.ndarray:
        """Execute the tick that was approached; return the variables after it, shape (size,)."""
        self._simulator.AdvancePendingEvents()
        return self.variables(self.context)

    def next_tick(self, section: Context) -> float:
        """Return the time of the next tick [s].

        Args:
            section: Context right after a tick.
        """
        # a product as in Drake's own schedule, so that rounding does not lose the tick
        return (round(section.get_time() / self.period) + 1) * self.period

    def approach(self, section: Context, x: np.ndarray | None = None) -> None:
        """Advance to the next tick, without executing it.

        A block that monitors differences between ticks finds the values of a run there; right after
        a tick it would compare a state with itself.

        Args:
            section: Context right after a tick; unchanged.
            x: Variables in place of its own, shape (size,).
        """
        context, time = self.context, section.get_time()
        context.SetTimeStateAndParametersFrom(section)
        if x is not None:
            for part in self._parts:
                self._set_part(context, part, x[part])
        context.SetTime(time + _BEHIND)
        self._simulator.Initialize(self._silent)
        self._simulator.AdvanceTo(self.next_tick(section))

    def as_sampled(self) -> Context:
        """Return the context at the tick that was approached, as sampling blocks find it.

        A discrete plant, which has an abstract state for contact, has made its step then.
        """
        if not self.context.num_abstract_states():
            return self.context
        found = self.context.Clone()
        self._diagram.CalcForcedUnrestrictedUpdate(self.context, found.get_mutable_state())
        return found

    def _set_part(self, context: Context, part: slice, values: np.ndarray) -> None:
        which = self._parts.index(part)
        if which == 0:
            context.SetContinuousState(values)
        else:
            context.SetDiscreteState(which - 1, values)
