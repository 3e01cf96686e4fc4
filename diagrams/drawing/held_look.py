"""Drawing of a workpiece that a robot holds, with the path on it, and of that robot."""

from pydrake.geometry import Box, Cylinder, Meshcat, Rgba
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.drawing.robot_geometry import RobotDrawing
from diagrams.scenario import HeldWorkpieceParameters, SolidParameters
from pfsc_drake.systems.drawing.robot_visualizer import RobotVisualizer
from pfsc_drake.systems.drawing.tool_visualizer import ToolPart, ToolVisualizer

_METAL = Rgba(0.72, 0.74, 0.78, 1.0)
# under which paths, surfaces and the tool's way are drawn, which move with the workpiece
_CARRIED = ("path_following", "surface_following")


class HeldLook:
    """Drawing of a workpiece and the robot that holds it.

    Args:
        workpiece: The workpiece.
        robot: How the robot is drawn; None where a turntable carries the workpiece.
    """

    def __init__(self, workpiece: HeldWorkpieceParameters, robot: RobotDrawing | None) -> None:
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
        """Draw the workpiece and the robot; what is drawn on the workpiece moves with it.

        Args:
            builder: Builder of the replay.
            workpiece_pose: ``[p_WC, R_WC by rows]``.
            positions: Positions of the robot's plant, if a robot holds it.
            meshcat: Where to draw.
            period: Time between frames [s].
        """
        for root in _CARRIED:
            parts = self._parts if root == _CARRIED[0] else []
            carried = ToolVisualizer(parts, meshcat, period, root)
            system = builder.AddNamedSystem(f"{root}_carried", carried)
            builder.Connect(workpiece_pose, system.GetInputPort("tool_pose"))
        if self.robot is None or positions is None:
            return
        robot = RobotVisualizer(self.robot.plant, self.robot.parts, meshcat, period, "holder")
        body = builder.AddNamedSystem("holder_visualizer", robot)
        builder.Connect(positions, body.GetInputPort("positions"))


def _shape(solid: SolidParameters) -> Box | Cylinder:
    return Box(*solid.box) if solid.box else Cylinder(*solid.cylinder)
