"""The load that a plant's tool is to a force/torque sensor."""

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, Joint, JointIndex, RigidBody, SpatialInertia, WeldJoint

from pfsc_drake.errors import InputError
from pfsc_drake.robot.tool_load import ToolLoad


def tool_load_from_plant(plant: MultibodyPlant, joint: Joint, tool_frame: Frame) -> ToolLoad:
    """Return everything that a plant has fixed behind a sensor.

    Args:
        plant: A finalized plant.
        joint: The fixed joint with the sensor in it; its child side is the tool.
        tool_frame: Frame at the tool point.

    Raises:
        InputError: If the joint is not fixed, something moves behind it, or the tool point is
            not behind it.
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
