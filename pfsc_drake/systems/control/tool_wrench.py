"""The wrench at the tool from torques in the joints."""

from pydrake.systems.framework import BasicVector, Context, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.control.estimation.tool_wrench import tool_wrench_function
from pfsc_drake.robot.robot_model import RobotModel


class ToolWrench(LeafSystem):
    """``tau_ext = J_g^T wrench`` solved for the wrench, see :func:`tool_wrench_function`.

    Ports:
        tau_ext (input): External torques in the joints [Nm or N], shape (N,).
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        wrench (output): ``[force, torque]`` on the tool at the tool point, world axes, shape
            (6,) [N, Nm].

    It has no state, and lets values that are not finite through.

    Args:
        robot: The robot.
        damping: Of the inverse.
        dead_bands: Widths for force [N] and torque [Nm].

    Raises:
        InputError: If a number is out of range, or the robot has too few joints.
    """

    def __init__(
        self, robot: RobotModel, damping: float = 0.0, dead_bands: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        super().__init__()
        n = robot.dimension
        function = BoundFunction(tool_wrench_function(robot, damping, dead_bands))
        self._q, self._argument = function.arguments["q"], function.arguments["tau_ext"]
        self._wrench, self._evaluate = function.results["wrench"], function.evaluate
        self._tau_ext = self.DeclareVectorInputPort("tau_ext", n)
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        self.DeclareVectorOutputPort(
            "wrench",
            6,
            self._calc_wrench,
            prerequisites_of_calc={self._tau_ext.ticket(), self._joint_state.ticket()},
        )

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        self._q[:] = self._joint_state.Eval(context)[: len(self._q)]
        self._argument[:] = self._tau_ext.Eval(context)
        self._evaluate()
        output.SetFromVector(self._wrench)
