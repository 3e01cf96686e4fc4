"""A wrench at the tool point, applied to a MultibodyPlant."""

from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.tool_load import joint_torque_function


class ExternalWrench(LeafSystem):
    """Applies a wrench to the body with the tool point.

    Force and torque of the input act **on the robot** at the origin of the tool frame;
    ``tau_ext = J_g(q_J)^T wrench`` (2.11) is what that means at the joints, with the sign
    of (2.65a), ``D_E q'' + n_E = tau_J + tau_ext``.

    Ports:
        wrench (input): ``[force, torque]`` at the tool point, world axes, shape (6,) [N, Nm].
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,); needed for ``tau_ext`` only.
        applied_spatial_force (output): For the plant's port of the same name, abstract; an
            empty list while there is no force.
        tau_ext (output): External torques on the link side, shape (N,) [Nm or N].

    Args:
        tool_frame: Frame at the tool point, in the plant.
        robot: The robot that carries it.
    """

    def __init__(self, tool_frame: Frame, robot: RobotModel) -> None:
        super().__init__()
        n = robot.dimension
        self._applied = ExternallyAppliedSpatialForce()
        self._applied.body_index = tool_frame.body().index()
        self._applied.p_BoBq_B = tool_frame.GetFixedPoseInBodyFrame().translation()
        self._function = BoundFunction(joint_torque_function(robot))
        self._q, self._argument = self._function.arguments.values()
        self._evaluate, self._tau_ext = self._function.evaluate, self._function.results["tau_ext"]
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        self.DeclareAbstractOutputPort(
            "applied_spatial_force",
            lambda: Value[list[ExternallyAppliedSpatialForce]](),
            self._calc_applied,
            prerequisites_of_calc={self._wrench.ticket()},
        )
        self.DeclareVectorOutputPort(
            "tau_ext",
            n,
            self._calc_tau_ext,
            prerequisites_of_calc={self._wrench.ticket(), self._joint_state.ticket()},
        )

    def _calc_applied(self, context: Context, output: Value) -> None:
        wrench = self._wrench.Eval(context)
        if not any(wrench.tolist()):
            output.set_value([])
            return
        # the value is a copy
        self._applied.F_Bq_W = SpatialForce(tau=wrench[3:], f=wrench[:3])
        output.set_value([self._applied])

    def _calc_tau_ext(self, context: Context, output: BasicVector) -> None:
        wrench = self._wrench.Eval(context)
        if not any(wrench.tolist()):
            output.SetZero()
            return
        self._q[:] = self._joint_state.Eval(context)[: len(self._q)]
        self._argument[:] = wrench
        self._evaluate()
        output.SetFromVector(self._tau_ext)
