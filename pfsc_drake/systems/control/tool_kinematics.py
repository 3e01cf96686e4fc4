"""Where the tool is."""

from pydrake.systems.framework import BasicVector, Context, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.robot.robot_model import RobotModel, pose_function


class ToolKinematics(LeafSystem):
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
        super().__init__()
        n = robot.dimension
        self._part = slice(2 * n, 3 * n) if of_motors else slice(0, n)
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        self.DeclareVectorOutputPort(
            "tool_pose",
            12,
            self._calc_tool_pose,
            prerequisites_of_calc={self._joint_state.ticket()},
        )
        function = BoundFunction(pose_function(robot))
        self._q, self._pose = function.arguments["q"], function.results["pose"]
        self._evaluate = function.evaluate

    def _calc_tool_pose(self, context: Context, output: BasicVector) -> None:
        self._q[:] = self._joint_state.Eval(context)[self._part]
        self._evaluate()
        output.SetFromVector(self._pose)
