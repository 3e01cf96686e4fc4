"""What is near of many regions, as a system."""

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
    """Tells :class:`FixtureGuidance` what is near, without looking at all regions at every tick.

    A schedule of distances has no fixed number of steps, and which one is due depends on values; so
    this is no block. Few regions need no schedule, see `near_rows`.

    Ports:
        place (input): ``z`` [m], and the clock of the regions now and after this tick [s], shape
            (5,).
        active (input, optional): Which regions are switched on, above 0.5, shape (M,); all of them
            if not connected. What is off does not take the place of what is on.
        near (output): Rows as of `near_rows`, how fast the tool may move for what was not looked at
            [m/s], and 1 of regions whose distance was computed, shape (48 + 1 + M,).

    State:
        Discrete: whether there was a look, and the memory of the schedule.

    Args:
        regions: All of them.
        num_regions: M.
        period: Sampling time [s].
    """

    def __init__(self, regions: ScheduledRegions, num_regions: int, period: float) -> None:
        super().__init__()
        self._regions, self._count = regions, num_regions
        size = 1 + regions.memory_size
        memory = self.discrete_state_ticket(self.DeclareDiscreteState(size))
        self._place = self.DeclareVectorInputPort("place", 5)
        self._active = self.DeclareVectorInputPort("active", num_regions)
        sources = {memory, self._place.ticket(), self._active.ticket()}
        look = ValueProducer(allocate=lambda: Value((None, None)), calc=self._look)
        self._seen = self.DeclareCacheEntry("look", look, sources)
        rows = NEAR_COLUMNS * MOST_NEAR
        self.DeclareVectorOutputPort(
            "near", rows + 1 + num_regions, self._calc_near, prerequisites_of_calc=sources
        )
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)

    def _look(self, context: Context, value: Value) -> None:
        """Look at what is due: what is told, and the state after it."""
        kept = context.get_discrete_state_vector().value()
        x, y, z, clock, clock_next = self._place.Eval(context).tolist()
        if not np.isfinite([x, y, z]).all():  # nothing is asked for then
            value.set_value((self._told([], 0.0, []), kept.copy()))
            return
        point = (x, y, z)
        memory = kept[1:] if kept[0] else self._regions.start(point, clock)
        sight = self._regions.look(memory, point, clock, clock_next)
        active = value_or_none(self._active, context)
        near = [p for p in sight.near if active is None or active[p.number] > 0.5]
        near = sorted(near, key=lambda p: p.h)[:MOST_NEAR]
        rows = [[p.number, p.h, p.h_next, *p.n] for p in near]
        after = np.concatenate([[1.0], sight.memory])
        value.set_value((self._told(rows, sight.speed_limit, sight.evaluated), after))

    def _told(self, rows: list[list[float]], limit: float, evaluated: Sequence[int]) -> np.ndarray:
        """Return the output."""
        absent = [[NOTHING, FAR, FAR, 0.0, 0.0, 0.0]] * (MOST_NEAR - len(rows))
        looked_at = np.zeros(self._count)
        looked_at[list(evaluated)] = 1.0
        return np.concatenate([np.ravel(rows + absent), [limit], looked_at])

    def _calc_near(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._seen.Eval(context)[0])

    def _initialize(self, context: Context, state: DiscreteValues) -> EventStatus:
        state.get_mutable_value()[:] = 0.0
        return EventStatus.Succeeded()

    def _update(self, context: Context, state: DiscreteValues) -> None:
        state.set_value(self._seen.Eval(context)[1])


def value_or_none(port: InputPort | None, context: Context) -> np.ndarray | None:
    """Return the value of a vector input, None if nothing is connected or there is no port.

    Args:
        port: The port.
        context: Context of its system.
    """
    if port is None or not port.HasValue(context):
        return None
    return port.Eval(context)
