"""Drawing of a workpiece that moves, with the path on it, and of the robot that holds it."""

from pydrake.geometry import Box, Cylinder, Meshcat, Rgba
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.drawing.robot_geometry import RobotDrawing
from diagrams.scenario import HolderWorkpiece, SolidParameters
from pfsc_drake.systems.drawing.robot_visualizer import RobotVisualizer
from pfsc_drake.systems.drawing.tool_visualizer import ToolPart, ToolVisualizer

_METAL = Rgba(0.72, 0.74, 0.78, 1.0)
# Meshcat paths of manifolds and of the tool's trail, which move with the workpiece
_MOVING = ("path_following", "surface_following")


class MovingWorkpieceDrawing:
    """Drawing of a workpiece that moves, and of the robot that holds it.

    Args:
        workpiece: The workpiece.
        robot: Drawing of the robot; None where a turntable carries the workpiece.
    """

    def __init__(self, workpiece: HolderWorkpiece, robot: RobotDrawing | None) -> None:
        self.robot = robot
        self._parts = [
            ToolPart(f"solid_{k}", _shape(solid), _METAL, solid.pose.transform())
            for k, solid in enumerate(workpiece.solids)
        ]

    def add(
        self,
        builder: DiagramBuilder,
        workpiece_pose: OutputPort,
        positions: OutputPort | None,
        meshcat: Meshcat,
        period: float,
    ) -> None:
        """Draw the workpiece and the robot; drawings on the workpiece move with it.

        Args:
            builder: Builder of the replay.
            workpiece_pose: ``[p_WC, R_WC by rows]``.
            positions: Positions of the robot's plant, if a robot holds it.
            meshcat: Meshcat instance to draw in.
            period: Time between frames [s].
        """
        for root in _MOVING:
            parts = self._parts if root == _MOVING[0] else []
            moving = ToolVisualizer(parts, meshcat, period, root)
            system = builder.AddNamedSystem(f"{root}_moving", moving)
            builder.Connect(workpiece_pose, system.GetInputPort("tool_pose"))
        if self.robot is None or positions is None:
            return
        robot = RobotVisualizer(self.robot.plant, self.robot.parts, meshcat, period, "holder")
        body = builder.AddNamedSystem("holder_visualizer", robot)
        builder.Connect(positions, body.GetInputPort("positions"))


def _shape(solid: SolidParameters) -> Box | Cylinder:
    return Box(*solid.box) if solid.box else Cylinder(*solid.cylinder)
