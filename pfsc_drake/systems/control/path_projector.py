"""Projection of the tool point onto the path, with the moving frame."""

import math

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus, LeafSystem

from pfsc_drake.geometry import Path, PathPointLayout, project_globally


class PathProjector(LeafSystem):
    """Orthogonal projection (3.6) onto a path and everything a law needs there.

    The only memory is the path parameter of the last tick, from which Newton's
    iteration (3.72) starts; at self-intersections it keeps the branch, and on closed
    paths it counts the laps. Arc length and parallel transport frame are functions
    of the parameter, so that neither drifts nor depends on the speed.

    Ports:
        tool_pose (input): ``[y_t, R_e]``, shape (12,); see :class:`ToolKinematics`.
        manifold_point (output): The path next to the tool, laid out by ``layout``.

    State:
        Discrete, shape (1,): ``theta*``, unwrapped. Until it is set, NaN; then the
        projection at initialization is global.

    Args:
        path: The path.
        relative_degree: ``r`` of the law that reads the output.
        period: Sampling time [s].
    """

    def __init__(self, path: Path, relative_degree: int, period: float) -> None:
        super().__init__()
        self._path = path
        self._evaluator = path.evaluator(relative_degree)
        self.layout: PathPointLayout = self._evaluator.layout
        theta = self.DeclareDiscreteState(np.array([np.nan]))
        self._tool_pose = self.DeclareVectorInputPort("tool_pose", 12)
        self._manifold_point = self.DeclareVectorOutputPort(
            "manifold_point",
            self.layout.size,
            self._calc_manifold_point,
            prerequisites_of_calc={
                self._tool_pose.ticket(),
                self.discrete_state_ticket(theta),
            },
        )
        self.DeclareInitializationDiscreteUpdateEvent(self._find_start)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._remember)

    def set_parameter(self, context: Context, theta: float) -> None:
        """Choose the branch of the path that the projection starts on."""
        context.SetDiscreteState(np.array([theta]))

    def _find_start(self, context: Context, state: DiscreteValues) -> EventStatus:
        theta = context.get_discrete_state_vector()[0]
        if np.isnan(theta):
            y_t = self._tool_pose.Eval(context)[:3]
            theta = project_globally(self._path.position, y_t).theta
        state.set_value(np.array([theta]))
        return EventStatus.Succeeded()

    def _calc_manifold_point(self, context: Context, output: BasicVector) -> None:
        y_t = self._tool_pose.Eval(context)[:3].tolist()
        output.set_value(self._evaluator(y_t, context.get_discrete_state_vector()[0]))

    def _remember(self, context: Context, state: DiscreteValues) -> None:
        theta = self._manifold_point.Eval(context).item(0)
        # a tool that is nowhere must not make the path's parameter forgotten
        if math.isfinite(theta):
            state[0] = theta
