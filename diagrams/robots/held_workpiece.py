"""The workpiece that a robot holds, as a body of its plant."""

from dataclasses import replace

from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import SpatialInertia, UnitInertia

from diagrams.robots.belief import BeliefSource
from diagrams.robots.model import tool_frame
from diagrams.scenario import HeldWorkpieceParameters, SolidParameters
from pfsc_drake.errors import InputError

# the body, and its frame, which the path of the robot is that of
WORKPIECE = "held_workpiece"


def holding(source: BeliefSource, workpiece: HeldWorkpieceParameters) -> BeliefSource:
    """Return where the belief of a robot comes from that holds a workpiece.

    The workpiece's frame is its tool frame then.

    Args:
        source: The same of the robot alone; its tool frame is where it holds the workpiece.
        workpiece: The workpiece.
    """
    grip = source.robot

    def add(plant: MultibodyPlant) -> None:
        if plant.HasBodyNamed(WORKPIECE):
            raise InputError(
                f"holder.robot.model: {grip.model} has a link '{WORKPIECE}'; allowed: models "
                "without one of that name"
            )
        frame = tool_frame(plant, grip)
        model = frame.body().model_instance()
        body = plant.AddRigidBody(WORKPIECE, model, workpiece_inertia(workpiece))
        plant.WeldFrames(frame, body.body_frame(), workpiece.pose.transform())

    return replace(source, robot=replace(grip, tool_frame=WORKPIECE), carried=add)


def workpiece_inertia(workpiece: HeldWorkpieceParameters) -> SpatialInertia:
    """Return a workpiece's inertia about the origin of its frame, axes of the frame.

    Args:
        workpiece: The workpiece.
    """
    total = SpatialInertia.Zero()
    for solid in workpiece.solids:
        total += _solid_inertia(solid)
    return total


def _solid_inertia(solid: SolidParameters) -> SpatialInertia:
    if solid.box:
        unit = UnitInertia.SolidBox(*solid.box)
    else:
        unit = UnitInertia.SolidCylinder(*solid.cylinder, [0.0, 0.0, 1.0])
    X_CS: RigidTransform = solid.pose.transform()
    central = SpatialInertia(solid.mass, [0.0, 0.0, 0.0], unit)
    return central.ReExpress(X_CS.rotation()).Shift(-X_CS.translation())
