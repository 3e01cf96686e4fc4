"""A station in Meshcat while it runs."""

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Meshcat, Rgba, Sphere
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, InputPort

from diagrams.drawing.legend import TOOL_COLOR
from diagrams.drawing.replay import arrange_scene, body_origins, camera_and_target
from diagrams.drawing.robot_geometry import RobotDrawing
from diagrams.robots.delta import DeltaPart
from diagrams.station import Station
from diagrams.tasks.drawing import draw_workpiece
from diagrams.tasks.task_drawing import drawing_of
from pfsc_drake.systems.drawing.robot_visualizer import DeltaVisualizer, RobotVisualizer
from pfsc_drake.systems.drawing.tool_visualizer import ForceArrows, ToolVisualizer, TrailVisualizer

_PIECES = 400  # of the tool's trail that stay
_TARGET, _TARGET_RADIUS, _HAND = "hand_target", 0.012, Rgba(0.95, 0.65, 0.05, 1.0)  # m


@dataclass(frozen=True)
class LiveFrame:
    """Visible state of a station at an instant.

    Attributes:
        positions: Positions of the plant that is drawn, shape (nq,).
        tool_pose: ``[y_t, R_e]``, shape (12,).
        manifold_point: The manifold next to the tool, shape (layout.size,).
        force: Between hand and robot, world axes [N], shape (3,), see :func:`felt_force`.
        target: Target of the hand that guides the tool [m], shape (3,), if there is one.
        commanded: Point commanded by the leader device [m], shape (3,), in a teleoperation.
    """

    positions: np.ndarray
    tool_pose: np.ndarray
    manifold_point: np.ndarray
    force: np.ndarray
    target: np.ndarray | None = None
    commanded: np.ndarray | None = None

    @property
    def hand(self) -> np.ndarray:
        """Position of the hand, in the world of the tool [m], shape (3,)."""
        return self.tool_pose[:3] if self.commanded is None else self.commanded


def felt_force(signals: dict[str, np.ndarray]) -> np.ndarray:
    """Return the force on the tool, or the force rendered by a leader device, shape (3,) [N].

    Args:
        signals: Current values by signal, from :meth:`SignalLog.now`.
    """
    return signals["leader_motor"] if "leader_motor" in signals else signals["wrench_ext"][:3]


class LiveView:
    """View of a station, drawn frame by frame.

    It is a diagram of its own, independent of the simulated one; its time counts frames.

    Args:
        station: The station.
        drawing: Drawing of its robot, if that is read from files.
        first: The first frame.
        meshcat: Meshcat instance to draw in.
        largest_force: Force with the longest arrow [N].
    """

    def __init__(
        self,
        station: Station,
        drawing: RobotDrawing | None,
        first: LiveFrame,
        meshcat: Meshcat,
        largest_force: float,
    ) -> None:
        builder, self._ports = DiagramBuilder(), dict[str, int]()
        self._frames, self._meshcat = 0, meshcat
        meshcat.SetObject(_TARGET, Sphere(_TARGET_RADIUS), _HAND)
        period = 1.0  # the time counts frames
        self._export(
            builder, "manifold_point", drawing_of(station.task).add(builder, meshcat, period)
        )
        trail = TrailVisualizer("path_following", TOOL_COLOR, meshcat, period, longest=_PIECES)
        builder.AddNamedSystem("trail", trail)
        self._export(builder, "trail_point", trail.GetInputPort("point"))
        arrows = builder.AddNamedSystem(
            "arrows", ForceArrows(1, largest_force, meshcat, period, "tool_force")
        )
        self._export(builder, "tool_point", arrows.GetInputPort("points"))
        self._export(builder, "force", arrows.GetInputPort("forces"))
        self._add_robot(builder, station, drawing, first, meshcat, period)
        self._add_workpiece(builder, station, meshcat, period)
        self._simulator = Simulator(builder.Build())
        self._fix(first, interrupted=False)
        self._simulator.Initialize()
        self._show_target(first.target)

    def draw(self, frame: LiveFrame, *, interrupted: bool = False) -> None:
        """Draw a frame.

        Args:
            frame: The frame.
            interrupted: Whether the tool's trail is interrupted between the last one and this one.
        """
        # states are updated when time leaves the last frame
        self._simulator.AdvanceTo(self._frames + 0.5)
        self._fix(frame, interrupted=interrupted)
        self._frames += 1
        self._simulator.AdvanceTo(float(self._frames))
        self._show_target(frame.target)

    def _show_target(self, target: np.ndarray | None) -> None:
        self._meshcat.SetProperty(_TARGET, "visible", target is not None)
        if target is not None:
            self._meshcat.SetTransform(_TARGET, RigidTransform(target))

    def _fix(self, frame: LiveFrame, *, interrupted: bool) -> None:
        tool_point = frame.tool_pose[:3]
        values = {
            "positions": frame.positions,
            "tool_pose": frame.tool_pose,
            "manifold_point": frame.manifold_point,
            "tool_point": tool_point,
            "trail_point": np.full(3, np.nan) if interrupted else tool_point,
            "force": frame.force,
        }
        diagram, root = self._simulator.get_system(), self._simulator.get_mutable_context()
        for name, port in self._ports.items():
            diagram.get_input_port(port).FixValue(root, values[name])

    def _export(self, builder: DiagramBuilder, name: str, port: InputPort) -> None:
        self._ports[name] = int(builder.ExportInput(port, name))

    def _add_robot(
        self,
        builder: DiagramBuilder,
        station: Station,
        drawing: RobotDrawing | None,
        first: LiveFrame,
        meshcat: Meshcat,
        period: float,
    ) -> None:
        """Add the robot, and aim the camera at it."""
        outline = np.concatenate(drawing_of(station.task).outline())
        if isinstance(station.part, DeltaPart):
            delta = DeltaVisualizer(station.part.robot, meshcat, period)
            builder.AddNamedSystem("robot", delta)
            self._export(builder, "positions", delta.GetInputPort("slide_positions"))
            arrange_scene(outline[:, 2], meshcat)
            return
        assert drawing is not None  # of every other robot
        robot = RobotVisualizer(drawing.plant, drawing.parts, meshcat, period)
        builder.AddNamedSystem("robot", robot)
        self._export(builder, "positions", robot.GetInputPort("positions"))
        bodies = body_origins(drawing.plant, first.positions)
        meshcat.SetCameraPose(*camera_and_target(outline, bodies))

    def _add_workpiece(
        self, builder: DiagramBuilder, station: Station, meshcat: Meshcat, period: float
    ) -> None:
        """Add the workpiece, if there is one."""
        if station.workpiece is None:
            return
        workpiece = station.workpiece.drawing(station.part.gravity)
        draw_workpiece(workpiece, meshcat)
        tool = builder.AddNamedSystem("tool", ToolVisualizer(workpiece.tool_parts, meshcat, period))
        self._export(builder, "tool_pose", tool.GetInputPort("tool_pose"))
