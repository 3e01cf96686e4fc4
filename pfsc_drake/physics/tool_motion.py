"""Where the tool is and how it moves."""

from typing import Any

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.robot.robot_model import RobotModel, tool_motion_function


class ToolMotion(Block):
    """Direct kinematics (2.5) of a robot's links, and their rates (2.11).

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,) [rad, rad/s or m, m/s].
        tool_motion (output): ``[y_t, R_e by rows, v, w]``: tool point [m], orientation, velocity
            of the tool point [m/s] and angular velocity [rad/s], world axes, shape (18,).

    Args:
        robot: The robot.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._size, self._motion = robot.dimension, tool_motion_function(robot)
        self.inputs = {"joint_state": Port(4 * robot.dimension, "rad, rad/s or m, m/s")}
        self.outputs, self.states = {"tool_motion": Port(18, "m, 1, m/s, rad/s")}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        n = self._size
        return {"tool_motion": self._motion(u.joint_state[:n], u.joint_state[n : 2 * n])}
