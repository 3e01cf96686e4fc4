"""Reaction forces of joints, tool and contacts; the tool as load of a force/torque sensor."""

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import GeometryId
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ContactResults, MultibodyPlant
from pydrake.multibody.tree import Frame, Joint, JointIndex, RigidBody, SpatialInertia, WeldJoint
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from pfsc_drake.compiled.bound_function import BoundFunction
from pfsc_drake.errors import InputError
from pfsc_drake.physics.force_torque_sensor import tool_reaction_function
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.tool_load import ToolLoad


class JointReaction(LeafSystem):
    """One of a plant's reaction forces as a vector.

    Ports:
        reaction_forces (input): The plant's reaction forces, abstract.
        reaction (output): ``[torque, force]`` on the joint's child, axes and origin of the joint's
            frame on it, shape (6,) [Nm, N].

    Args:
        index: Index of the joint in the plant's reactions, see :func:`reaction_index`.
    """

    def __init__(self, index: int) -> None:
        super().__init__()
        self._index = index
        self._forces = self.DeclareAbstractInputPort("reaction_forces", Value[list[SpatialForce]]())
        self.DeclareVectorOutputPort(
            "reaction", 6, self._calc_reaction, prerequisites_of_calc={self._forces.ticket()}
        )

    def _calc_reaction(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._forces.Eval(context)[self._index].get_coeffs())


def reaction_index(plant: MultibodyPlant, joint: Joint) -> int:
    """Return the index of a joint in a plant's reaction forces.

    Args:
        plant: A finalized plant.
        joint: The joint with the sensor in it.

    Raises:
        InputError: If the joint is not fixed.
    """
    if not isinstance(joint, WeldJoint):
        raise InputError(
            f"joint '{joint.name()}' of the force/torque sensor: type '{joint.type_name()}'; "
            "must be a fixed joint"
        )
    # reactions are numbered without gaps, also where joints were removed
    return list(plant.GetJointIndices()).index(joint.index())


class ToolReaction(LeafSystem):
    """Newton-Euler equations of the tool alone, see :func:`tool_reaction_function`.

    Ports:
        joint_state (input): Simulated ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        acceleration (input): Accelerations of the links, from the plant, shape (N,).
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


class ContactWrench(LeafSystem):
    """Sums the hydroelastic contact forces on one body.

    Ports:
        contact_results (input): Contacts of the plant, abstract.
        tool_pose (input): ``[y_t, R_e]``, shape (12,); the torque is about ``y_t``.
        wrench (output): ``[force, torque]`` on the body, world axes, shape (6,) [N, Nm].

    Args:
        geometries: Contact geometries of the body.
    """

    def __init__(self, geometries: list[GeometryId]) -> None:
        super().__init__()
        self._geometries = frozenset(geometries)
        self._results = self.DeclareAbstractInputPort("contact_results", Value[ContactResults]())
        self._pose = self.DeclareVectorInputPort("tool_pose", 12)
        self.DeclareVectorOutputPort(
            "wrench",
            6,
            self._calc_wrench,
            prerequisites_of_calc={self._results.ticket(), self._pose.ticket()},
        )

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        results, y_t = self._results.Eval(context), self._pose.Eval(context)[:3]
        wrench = np.zeros(6)
        for i in range(results.num_hydroelastic_contacts()):
            info = results.hydroelastic_contact_info(i)
            surface, F_Ac_W = info.contact_surface(), info.F_Ac_W()
            on_M, on_N = surface.id_M() in self._geometries, surface.id_N() in self._geometries
            # F_Ac_W acts on the body of M, the opposite force on the body of N
            sign = float(on_M) - float(on_N)
            force = sign * F_Ac_W.translational()
            wrench[:3] += force
            wrench[3:] += sign * F_Ac_W.rotational() + np.cross(surface.centroid() - y_t, force)
        output.SetFromVector(wrench)


def tool_load_from_plant(plant: MultibodyPlant, joint: Joint, tool_frame: Frame) -> ToolLoad:
    """Return the load of everything fixed behind a sensor in a plant.

    Args:
        plant: A finalized plant.
        joint: The fixed joint with the sensor in it; its child side is the tool.
        tool_frame: Frame at the tool point.

    Raises:
        InputError: If the joint is not fixed, a part moves behind it, or the tool point is not
            behind it.
    """
    bodies = _bodies_behind(plant, joint)
    if tool_frame.body().index() not in [body.index() for body in bodies]:
        raise InputError(
            f"tool frame '{tool_frame.name()}': is not behind the joint '{joint.name()}' of the "
            "force/torque sensor; it must be fixed to that joint's child"
        )
    context = plant.CreateDefaultContext()
    frame_S = joint.frame_on_child()
    M = SpatialInertia.Zero()
    for body in bodies:
        X_SB = plant.CalcRelativeTransform(context, frame_S, body.body_frame())
        M_B = body.CalcSpatialInertiaInBodyFrame(context)
        M += M_B.ReExpress(X_SB.rotation()).Shift(-X_SB.translation())
    p_SC = M.get_com()
    I_C = M.Shift(p_SC).CalcRotationalInertia().CopyToFullMatrix3()
    X_ST = plant.CalcRelativeTransform(context, frame_S, tool_frame)
    gravity = plant.gravity_field().gravity_vector()
    R_ST, p_ST = X_ST.rotation().matrix(), X_ST.translation()
    return ToolLoad(M.get_mass(), p_SC, I_C, R_ST, p_ST, gravity)


def _bodies_behind(plant: MultibodyPlant, sensor: Joint) -> list[RigidBody]:
    """Return the bodies on the child side of a fixed joint."""
    if not isinstance(sensor, WeldJoint):
        raise InputError(
            f"joint '{sensor.name()}' of the force/torque sensor: type '{sensor.type_name()}'; "
            "must be a fixed joint"
        )
    bodies = [sensor.child_body()]
    joints = [plant.get_joint(JointIndex(i)) for i in plant.GetJointIndices()]
    joints = [joint for joint in joints if joint.index() != sensor.index()]
    for body in bodies:
        for joint in joints:
            ends = [joint.parent_body(), joint.child_body()]
            if body.index() not in [end.index() for end in ends]:
                continue
            if not isinstance(joint, WeldJoint):
                raise InputError(
                    f"joint '{joint.name()}': moves behind the force/torque sensor in "
                    f"'{sensor.name()}'; only fixed joints are allowed there"
                )
            known = [b.index() for b in bodies]
            bodies += [end for end in ends if end.index() not in known]
    return bodies
