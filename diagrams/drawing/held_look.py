"""What a workpiece looks like that a robot holds, with the path on it, and that robot."""

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Box, Cylinder, Meshcat, Rgba
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.drawing.recorded import RecordedHolder
from diagrams.drawing.robot_geometry import RobotDrawing
from diagrams.scenario import HeldWorkpieceParameters, SolidParameters
from pfsc_drake.systems.drawing.robot_visualizer import RobotVisualizer
from pfsc_drake.systems.drawing.tool_visualizer import ToolPart, ToolVisualizer

_METAL = Rgba(0.72, 0.74, 0.78, 1.0)
# under which paths, surfaces and the tool's way are drawn, which move with the workpiece
_CARRIED = ("path_following", "surface_following")


@dataclass(frozen=True)
class HeldLook:
    """How a workpiece and the robot that holds it are drawn.

    Attributes:
        parts: What the workpiece consists of, in its frame.
        robot: The robot; None where a turntable carries the workpiece.
    """

    parts: list[ToolPart]
    robot: RobotDrawing | None


def held_look(workpiece: HeldWorkpieceParameters, robot: RobotDrawing | None) -> HeldLook:
    """Return how a workpiece and the robot that holds it are drawn.

    Args:
        workpiece: The workpiece.
        robot: How the robot is drawn, if one holds it.
    """
    parts = [
        ToolPart(f"solid_{k}", _shape(solid), _METAL, solid.pose.transform())
        for k, solid in enumerate(workpiece.solids)
    ]
    return HeldLook(parts, robot)


def _shape(solid: SolidParameters) -> Box | Cylinder:
    return Box(*solid.box) if solid.box else Cylinder(*solid.cylinder)


def held_points(points: np.ndarray, held: RecordedHolder) -> np.ndarray:
    """Return points of the workpiece where it is at the first frame [m], shape (K, 3).

    Args:
        points: Points in its frame [m], shape (K, 3).
        held: What the robot does that holds it.
    """
    pose = held.workpiece_pose[0]
    return np.asarray(pose[:3] + points @ pose[3:].reshape(3, 3).T)


def add_held_drawing(
    builder: DiagramBuilder,
    look: HeldLook,
    workpiece_pose: OutputPort,
    positions: OutputPort | None,
    meshcat: Meshcat,
    period: float,
) -> None:
    """Draw a workpiece and the robot that holds it; what is drawn on it moves with it.

    Args:
        builder: Builder of the replay.
        look: How they are drawn.
        workpiece_pose: ``[p_WC, R_WC by rows]``.
        positions: Positions of the robot's plant, if a robot holds it.
        meshcat: Where to draw.
        period: Time between frames [s].
    """
    for root in _CARRIED:
        parts = look.parts if root == _CARRIED[0] else []
        carried = ToolVisualizer(parts, meshcat, period, root)
        system = builder.AddNamedSystem(f"{root}_carried", carried)
        builder.Connect(workpiece_pose, system.GetInputPort("tool_pose"))
    if look.robot is None or positions is None:
        return
    plant, drawn = look.robot.plant, look.robot.parts
    robot = RobotVisualizer(plant, drawn, meshcat, period, "holder")
    body = builder.AddNamedSystem("holder_visualizer", robot)
    builder.Connect(positions, body.GetInputPort("positions"))
