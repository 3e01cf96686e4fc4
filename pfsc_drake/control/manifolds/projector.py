"""Where the tool is, and its projection onto a manifold with everything that a law needs there."""

from typing import Any, Protocol

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.control.manifolds.manifold import PlaceLayout
from pfsc_drake.robot.robot_model import RobotModel, pose_function


class ToolKinematics(Block):
    """Direct kinematics (2.5) of a robot.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,) [rad, rad/s or m, m/s].
        tool_pose (output): ``[y_t, R_e]``, tool point [m] and orientation by rows, in
            world axes, shape (12,).

    Args:
        robot: The robot.
        of_motors: Whether the pose is that of the motor coordinates q_M, for laws that
            act on them.
    """

    def __init__(self, robot: RobotModel, of_motors: bool = False) -> None:
        n = robot.dimension
        self._part = slice(2 * n, 3 * n) if of_motors else slice(0, n)
        self._pose = pose_function(robot)
        self.inputs = {"joint_state": Port(4 * n, "rad, rad/s or m, m/s")}
        self.outputs, self.states = {"tool_pose": Port(12, "m, 1")}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        return {"tool_pose": self._pose(u.joint_state[self._part])}


class PlaceEvaluator(Protocol):
    """A manifold next to a point, as functions."""

    @property
    def layout(self) -> PlaceLayout:
        """Layout of the manifold's point."""

    @property
    def evaluate(self) -> ca.Function:
        """``(y_t, memory) -> manifold_point``: what is next to a point, from the last place on."""

    @property
    def find(self) -> ca.Function:
        """``y_t -> memory``: the nearest place on all of the manifold."""


class Projector(Block):
    """Orthogonal projection onto a manifold, (3.6), (4.9).

    Its memory is the place of the last tick, from which Newton's iteration (3.72), (4.48) starts;
    at self-intersections it keeps the branch, and in closed directions it counts the rounds. Of a
    path that is the parameter ``theta*``, unwrapped, alone: arc length and parallel transport frame
    are functions of it, so that neither drifts nor depends on the speed.

    Ports:
        tool_pose (input): ``[y_t, R_e]``, shape (12,); see :class:`ToolKinematics`.
        manifold_point (output): The manifold next to the tool, laid out by ``layout``.

    State:
        place: The part ``layout.memory`` of the last point. It starts at the nearest place on all
        of the manifold, and stays where it is while the tool is nowhere.

    Args:
        evaluator: The manifold.
        start: What is added to the place that is found at the start, such as the lengths that a
            motion along a surface begins with; nothing if omitted.

    Attributes:
        layout: Of the manifold's point.
    """

    def __init__(self, evaluator: PlaceEvaluator, start: np.ndarray | None = None) -> None:
        self.layout, self._evaluator = evaluator.layout, evaluator
        memory = self.layout.memory
        self.inputs = {"tool_pose": Port(12, "m, 1")}
        self.outputs = {"manifold_point": Port(self.layout.size)}
        self.states = {"place": memory.stop - memory.start}
        self._start = np.zeros(self.states["place"]) if start is None else start

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        return {"place": self._evaluator.find(u.tool_pose[:3]) + ca.DM(self._start)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        return {"manifold_point": self._evaluator.evaluate(u.tool_pose[:3], x.place)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        place = y.manifold_point[self.layout.memory]
        return {"place": where(all_finite(place), place, x.place)}
