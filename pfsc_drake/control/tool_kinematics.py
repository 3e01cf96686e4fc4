"""Where the tool is."""

from typing import Any

from pfsc_drake.blocks.block import Block, Port, Values
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
