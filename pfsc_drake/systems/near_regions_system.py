"""Nearest of many regions, as a system."""

from collections.abc import Sequence

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiscreteValues,
    EventStatus,
    InputPort,
    LeafSystem,
    ValueProducer,
)

from pfsc_drake.control.fixtures.contact_program import MOST_NEAR
from pfsc_drake.control.fixtures.fixture_guidance import NEAR_COLUMNS
from pfsc_drake.control.fixtures.near_regions import FAR, NOTHING, ScheduledRegions


class NearRegions(LeafSystem):
    """Evaluates the nearest regions for :class:`FixtureGuidance`, with few distances at each tick.

    A schedule of distance evaluations has no fixed number of steps and depends on values; therefore
    this is not a block. Few regions need no schedule, see `near_rows`.

    Ports:
        place (input): ``z`` [m], and the clock of the regions now and after this tick [s], shape
            (5,).
        active (input, optional): Flags of the regions that are switched on (above 0.5), shape (M,);
            all of them if not connected. Regions that are off do not displace others.
        near (output): Rows as of `near_rows`, the speed limit for regions that were not evaluated
            [m/s], and a flag for each region whose distance was evaluated, shape (48 + 1 + M,).

    State:
        Discrete: whether there was an evaluation, and the memory of the schedule.

    Args:
        regions: All regions.
        num_regions: M.
        period: Sampling time [s].
    """

    def __init__(self, regions: ScheduledRegions, num_regions: int, period: float) -> None:
        super().__init__()
        self._regions, self._count = regions, num_regions
        size = 1 + regions.memory_size
        memory = self.discrete_state_ticket(self.DeclareDiscreteState(size))
        self._position = self.DeclareVectorInputPort("evaluation_point", 5)
        self._active = self.DeclareVectorInputPort("active", num_regions)
        sources = {memory, self._position.ticket(), self._active.ticket()}
        producer = ValueProducer(allocate=lambda: Value((None, None)), calc=self._evaluate)
        self._rows = self.DeclareCacheEntry("near", producer, sources)
        rows = NEAR_COLUMNS * MOST_NEAR
        self.DeclareVectorOutputPort(
            "near", rows + 1 + num_regions, self._calc_near, prerequisites_of_calc=sources
        )
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _evaluate(self, context: Context, value: Value) -> None:
        """Evaluate the distances that are due: the output, and the next state."""
        state = context.get_discrete_state_vector().value()
        x, y, z, clock, clock_next = self._position.Eval(context).tolist()
        if not np.isfinite([x, y, z]).all():  # nothing to evaluate
            value.set_value((self._row([], 0.0, []), state.copy()))
            return
        point = (x, y, z)
        memory = state[1:] if state[0] else self._regions.start(point, clock)
        found = self._regions.update(memory, point, clock, clock_next)
        active = value_or_none(self._active, context)
        near = [p for p in found.near if active is None or active[p.number] > 0.5]
        near = sorted(near, key=lambda p: p.h)[:MOST_NEAR]
        rows = [[p.number, p.h, p.h_next, *p.n] for p in near]
        after = np.concatenate([[1.0], found.memory])
        value.set_value((self._row(rows, found.speed_limit, found.evaluated), after))

    def _row(self, rows: list[list[float]], limit: float, evaluated: Sequence[int]) -> np.ndarray:
        """Return the output."""
        absent = [[NOTHING, FAR, FAR, 0.0, 0.0, 0.0]] * (MOST_NEAR - len(rows))
        evaluated_flags = np.zeros(self._count)
        evaluated_flags[list(evaluated)] = 1.0
        return np.concatenate([np.ravel(rows + absent), [limit], evaluated_flags])

    def _calc_near(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._rows.Eval(context)[0])

    def _initialize(self, context: Context, state: DiscreteValues) -> EventStatus:
        state.get_mutable_value()[:] = 0.0
        return EventStatus.Succeeded()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._rows.Eval(context)[1])


def value_or_none(port: InputPort | None, context: Context) -> np.ndarray | None:
    """Return the value of a vector input, None if nothing is connected or there is no port.

    Args:
        port: The port.
        context: Context of its system.
    """
    if port is None or not port.HasValue(context):
        return None
    return port.Eval(context)
