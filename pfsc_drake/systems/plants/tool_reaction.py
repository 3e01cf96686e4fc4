"""What the joint between flange and tool bears, of plants that do not tell it."""

from pydrake.systems.framework import BasicVector, Context, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.physics.tool_reaction import tool_reaction_function
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.tool_load import ToolLoad


class ToolReaction(LeafSystem):
    """Newton and Euler for the tool alone, see :func:`tool_reaction_function`.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, the true ones, shape (4N,).
        acceleration (input): Of the links, from the plant, shape (N,).
        wrench (input): ``[force, torque]`` on the tool at the tool point, world axes, shape
            (6,) [N, Nm]; zero if not connected.
        reaction (output): ``[torque, force]`` on the tool, axes and origin of the sensor,
            shape (6,) [Nm, N].

    Args:
        robot: The robot.
        load: Everything behind the sensor.
    """

    def __init__(self, robot: RobotModel, load: ToolLoad) -> None:
        super().__init__()
        n = robot.dimension
        function = BoundFunction(tool_reaction_function(robot, load))
        self._q, self._v, self._a, self._f = function.arguments.values()
        self._reaction, self._evaluate = function.results["reaction"], function.evaluate
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        self._acceleration = self.DeclareVectorInputPort("acceleration", n)
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self.DeclareVectorOutputPort(
            "reaction",
            6,
            self._calc_reaction,
            prerequisites_of_calc={
                port.ticket() for port in (self._joint_state, self._acceleration, self._wrench)
            },
        )

    def _calc_reaction(self, context: Context, output: BasicVector) -> None:
        n, state = len(self._q), self._joint_state.Eval(context)
        self._q[:], self._v[:] = state[:n], state[n : 2 * n]
        self._a[:] = self._acceleration.Eval(context)
        self._f[:] = self._wrench.Eval(context) if self._wrench.HasValue(context) else 0.0
        self._evaluate()
        output.SetFromVector(self._reaction)
