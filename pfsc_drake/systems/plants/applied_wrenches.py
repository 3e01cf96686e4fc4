"""External wrenches, applied to bodies of a plant."""

from collections.abc import Collection, Sequence

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import GeometryId
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ContactResults, ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex, Frame
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.physics.link_forces import link_torque_function
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.link_points import LinkPoint
from pfsc_drake.robot.tool_load import joint_torque_function


class AppliedForces(LeafSystem):
    """Wrenches on bodies, in the form of a plant's input.

    Ports:
        wrenches (input): ``[force, torque]`` on each of K bodies at its origin, world axes, shape
            (6 K,) [N, Nm].
        applied_spatial_force (output): For the port of that name of the plant, abstract.

    Args:
        bodies: The K bodies.
    """

    def __init__(self, bodies: list[BodyIndex]) -> None:
        super().__init__()
        self._applied = [ExternallyAppliedSpatialForce() for _ in bodies]
        for applied, body in zip(self._applied, bodies, strict=True):
            applied.body_index, applied.p_BoBq_B = body, np.zeros(3)
        self._wrenches = self.DeclareVectorInputPort("wrenches", 6 * len(bodies))
        self.DeclareAbstractOutputPort(
            "applied_spatial_force",
            lambda: Value[list[ExternallyAppliedSpatialForce]](),
            self._calc_applied,
            prerequisites_of_calc={self._wrenches.ticket()},
        )

    def _calc_applied(self, context: Context, output: Value) -> None:
        wrenches = self._wrenches.Eval(context).reshape(-1, 6)
        for applied, wrench in zip(self._applied, wrenches, strict=True):
            applied.F_Bq_W = SpatialForce(tau=wrench[3:], f=wrench[:3])
        # the value is a copy
        output.set_value(self._applied)


class PartnerForces(LeafSystem):
    """Sums the point contact forces of each of K partners on the bodies that touch it.

    Ports:
        contact_results (input): Contacts of the plant, abstract.
        forces (output): Forces by the partners one after the other, world axes, shape (3 K,) [N].

    Args:
        partners: Contact geometries of each partner; no two partners touch each other.
    """

    def __init__(self, partners: Sequence[Collection[GeometryId]]) -> None:
        super().__init__()
        self._partners = {g: k for k, partner in enumerate(partners) for g in partner}
        self._size = len(partners)
        self._results = self.DeclareAbstractInputPort("contact_results", Value[ContactResults]())
        self.DeclareVectorOutputPort(
            "forces",
            3 * len(partners),
            self._calc_forces,
            prerequisites_of_calc={self._results.ticket()},
        )

    def _calc_forces(self, context: Context, output: BasicVector) -> None:
        results, forces = self._results.Eval(context), np.zeros((self._size, 3))
        for i in range(results.num_point_pair_contacts()):
            info = results.point_pair_contact_info(i)
            pair, force = info.point_pair(), info.contact_force()  # on B
            if pair.id_A in self._partners:
                forces[self._partners[pair.id_A]] += force
            elif pair.id_B in self._partners:
                forces[self._partners[pair.id_B]] -= force
        output.SetFromVector(forces.ravel())


class ExternalWrench(LeafSystem):
    """Applies a wrench to the body with the tool point.

    Force and torque of the input act **on the robot** at the origin of the tool frame. Their joint
    torques are ``tau_ext = J_g(q_J)^T wrench`` (2.11), with the sign of (2.65a),
    ``D_E q'' + n_E = tau_J + tau_ext``.

    Ports:
        wrench (input): ``[force, torque]`` at the tool point, world axes, shape (6,) [N, Nm].
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,); needed for ``tau_ext`` only.
        applied_spatial_force (output): For the plant's port of the same name, abstract; an
            empty list while there is no force.
        tau_ext (output): External torques on the link side, shape (N,) [Nm or N].

    Args:
        tool_frame: Frame at the tool point, in the plant.
        robot: The robot with this tool.
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


class LinkPushes(LeafSystem):
    """Applies wrenches to points of an arm's links.

    Forces and torques act **on the robot**. Their joint torques are
    ``tau_ext = sum_k J_k(q_J)^T wrench_k``, with the sign of (2.65a),
    ``D_E q'' + n_E = tau_J + tau_ext``.

    Ports:
        wrenches (input): ``[force, torque]`` at each of K points, world axes, shape (6K,)
            [N, Nm].
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,); not needed for the next.
        applied_spatial_force (output): For the port of that name of a plant, abstract; without
            points whose wrench is zero.
        tau_ext (output): External torques on the link side, shape (N,) [Nm or N], for plants
            without forces on bodies.

    Args:
        chain: The arm, N joints.
        points: The K points.
    """

    def __init__(self, chain: SerialChain, points: Sequence[LinkPoint]) -> None:
        super().__init__()
        self.points = tuple(points)
        n, size = chain.dimension, len(self.points)
        link_points = [(point.link, point.p_LQ) for point in self.points]
        self._torque_of = BoundFunction(link_torque_function(chain, link_points))
        self._wrenches = self.DeclareVectorInputPort("wrenches", 6 * size)
        self._joint_state = self.DeclareVectorInputPort("joint_state", 4 * n)
        self.DeclareAbstractOutputPort(
            "applied_spatial_force",
            lambda: Value[list[ExternallyAppliedSpatialForce]](),
            self._calc_applied,
            prerequisites_of_calc={self._wrenches.ticket()},
        )
        self.DeclareVectorOutputPort(
            "tau_ext",
            n,
            self._calc_tau_ext,
            prerequisites_of_calc={self._wrenches.ticket(), self._joint_state.ticket()},
        )

    def _calc_applied(self, context: Context, output: Value) -> None:
        applied, wrenches = [], self._wrenches.Eval(context)
        for k, point in enumerate(self.points):
            wrench = wrenches[6 * k : 6 * k + 6]
            if not any(wrench.tolist()):
                continue
            force = ExternallyAppliedSpatialForce()
            force.body_index, force.p_BoBq_B = point.body, point.p_BQ
            force.F_Bq_W = SpatialForce(tau=wrench[3:], f=wrench[:3])
            applied.append(force)
        output.set_value(applied)

    def _calc_tau_ext(self, context: Context, output: BasicVector) -> None:
        wrenches = self._wrenches.Eval(context)
        if not any(wrenches.tolist()):
            output.SetZero()
            return
        arguments = self._torque_of.arguments
        arguments["q"][:] = self._joint_state.Eval(context)[: len(arguments["q"])]
        arguments["wrenches"][:] = wrenches
        self._torque_of.evaluate()
        output.SetFromVector(self._torque_of.results["tau_ext"])
