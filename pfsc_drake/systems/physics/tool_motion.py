"""Where the tool is and how it moves."""

from pydrake.systems.framework import BasicVector, Context, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.robot.robot_model import RobotModel, tool_motion_function


class ToolMotion(LeafSystem):
    """Direct kinematics (2.5) of a robot's links, and their rates (2.11).

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,) [rad, rad/s or m, m/s].
        tool_motion (output): ``[y_t, R_e by rows, v, w]``: tool point [m], orientation, velocity
            of the tool point [m/s] and angular velocity [rad/s], world axes, shape (18,).

    Args:
        robot: The robot.
    """

    def __init__(self, robot: RobotModel) -> None:
        super().__init__()
        n = robot.dimension
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        self.DeclareVectorOutputPort(
            "tool_motion",
            18,
            self._calc_motion,
            prerequisites_of_calc={self._joint_state.ticket()},
        )
        function = BoundFunction(tool_motion_function(robot))
        self._q, self._v = function.arguments["q"], function.arguments["v"]
        self._motion, self._evaluate = function.results["motion"], function.evaluate

    def _calc_motion(self, context: Context, output: BasicVector) -> None:
        state, n = self._joint_state.Eval(context), len(self._q)
        self._q[:], self._v[:] = state[:n], state[n : 2 * n]
        self._evaluate()
        output.SetFromVector(self._motion)
