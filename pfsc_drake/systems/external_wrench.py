"""A wrench at the tool point, applied to a MultibodyPlant."""

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from pfsc_drake.control.tool_load import joint_torque_function
from pfsc_drake.robot.robot_model import RobotModel


class ExternalWrench(LeafSystem):
    """Applies a wrench to the body with the tool point.

    Force and torque of the input act **on the robot** at the origin of the tool frame;
    ``tau_ext = J_g(q_J)^T wrench`` (2.11) is what that means at the joints, with the sign
    of (2.65a), ``D_E q'' + n_E = tau_J + tau_ext``.

    Ports:
        wrench (input): ``[force, torque]`` at the tool point, world axes, shape (6,) [N, Nm].
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,); needed for ``tau_ext`` only.
        applied_spatial_force (output): For the plant's port of the same name, abstract.
        tau_ext (output): External torques on the link side, shape (N,) [Nm or N].

    Args:
        tool_frame: Frame at the tool point, in the plant.
        robot: The robot that carries it.
    """

    def __init__(self, tool_frame: Frame, robot: RobotModel) -> None:
        super().__init__()
        n = robot.dimension
        self._body = tool_frame.body().index()
        self._p_BoT_B = tool_frame.GetFixedPoseInBodyFrame().translation()
        self._q, self._argument, self._tau_ext = np.zeros(n), np.zeros(6), np.zeros(n)
        self._buffer, self._evaluate = joint_torque_function(robot).buffer()
        self._buffer.set_arg(0, self._q.data)
        self._buffer.set_arg(1, self._argument.data)
        self._buffer.set_res(0, self._tau_ext.data)
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
        applied = ExternallyAppliedSpatialForce()
        applied.body_index = self._body
        applied.p_BoBq_B = self._p_BoT_B
        applied.F_Bq_W = SpatialForce(tau=wrench[3:], f=wrench[:3])
        output.set_value([applied])

    def _calc_tau_ext(self, context: Context, output: BasicVector) -> None:
        self._q[:] = self._joint_state.Eval(context)[: len(self._q)]
        self._argument[:] = self._wrench.Eval(context)
        self._evaluate()
        output.SetFromVector(self._tau_ext)
