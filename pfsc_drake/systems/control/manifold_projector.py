"""Projection of the tool point onto a manifold, with everything that a law needs there."""

from collections.abc import Callable, Sequence

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.control.manifolds.manifold import PlaceLayout


class ManifoldProjector(LeafSystem):
    """Orthogonal projection onto a manifold, (3.6), (4.9).

    Its memory is the place of the last tick, from which Newton's iteration (3.72), (4.48) starts;
    at self-intersections it keeps the branch, and in closed directions it counts the rounds.

    Ports:
        tool_pose (input): ``[y_t, R_e]``, shape (12,); see :class:`ToolKinematics`.
        manifold_point (output): The manifold next to the tool, laid out by ``layout``.

    State:
        Discrete: the part ``layout.memory`` of the last point. Until it is set, NaN; then the
        projection at initialization is global.

    Args:
        layout: Layout of the manifold's point.
        evaluate: ``(y_t, memory) -> point``, without memory of its own.
        find: ``y_t -> memory``, the nearest place on all of the manifold.
        period: Sampling time [s].
    """

    def __init__(
        self,
        layout: PlaceLayout,
        evaluate: Callable[[Sequence[float], np.ndarray], np.ndarray],
        find: Callable[[np.ndarray], np.ndarray],
        period: float,
    ) -> None:
        super().__init__()
        self._evaluate, self._find, self._memory = evaluate, find, layout.memory
        size = layout.memory.stop - layout.memory.start
        memory = self.DeclareDiscreteState(np.full(size, np.nan))
        self._tool_pose = self.DeclareVectorInputPort("tool_pose", 12)
        self._manifold_point = self.DeclareVectorOutputPort(
            "manifold_point",
            layout.size,
            self._calc_manifold_point,
            prerequisites_of_calc={
                self._tool_pose.ticket(),
                self.discrete_state_ticket(memory),
            },
        )
        self.DeclareInitializationDiscreteUpdateEvent(self._find_start)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._remember)

    def set_place(self, context: Context, memory: np.ndarray) -> None:
        """Choose the branch of the manifold that the projection starts on.

        Args:
            context: The system's own.
            memory: See the state.
        """
        context.SetDiscreteState(memory)

    def _find_start(self, context: Context, state: DiscreteValues) -> EventStatus:
        memory = context.get_discrete_state_vector().value()
        if np.isnan(memory).any():
            memory = self._find(self._tool_pose.Eval(context)[:3])
        state.set_value(memory)
        return EventStatus.Succeeded()

    def _calc_manifold_point(self, context: Context, output: BasicVector) -> None:
        y_t = self._tool_pose.Eval(context)[:3].tolist()
        output.set_value(self._evaluate(y_t, context.get_discrete_state_vector().value()))

    def _remember(self, context: Context, state: DiscreteValues) -> None:
        memory = self._manifold_point.Eval(context)[self._memory]
        # a tool that is nowhere must not make the place forgotten
        if np.isfinite(memory).all():
            state.set_value(memory)
