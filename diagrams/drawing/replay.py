"""A logged run in Meshcat: robot, path, moving frame and trail of the tool."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from diagrams.drawing.robot_geometry import RobotDrawing
from pfsc_drake.geometry import Path, PathPointLayout
from pfsc_drake.systems.drawing.path_visualizer import PathVisualizer
from pfsc_drake.systems.drawing.robot_visualizer import RobotVisualizer


@dataclass(frozen=True)
class RecordedMotion:
    """What a log holds of a motion, at the recording's frames.

    Attributes:
        times: Times of the frames [s], shape (frames,), increasing from 0.
        positions: The plant's positions, shape (frames, nq).
        tool_pose: ``[y_t, R_e]``, shape (frames, 12).
        path_point: The path next to the tool, shape (frames, layout.size).
    """

    times: np.ndarray
    positions: np.ndarray
    tool_pose: np.ndarray
    path_point: np.ndarray


def build_replay(
    robot: RobotDrawing,
    path: Path,
    layout: PathPointLayout,
    motion: RecordedMotion,
    meshcat: Meshcat,
    period: float,
) -> Diagram:
    """Return a diagram that draws a recorded motion while its time advances.

    Args:
        robot: How the robot is drawn.
        path: The path.
        layout: Layout of the path points.
        motion: What to draw.
        meshcat: Where to draw.
        period: Time between frames [s].
    """
    _aim_camera(path, meshcat)
    builder = DiagramBuilder()
    signals: Mapping[str, np.ndarray] = {
        "positions": motion.positions,
        "tool_pose": motion.tool_pose,
        "path_point": motion.path_point,
    }
    sources = {name: add_source(builder, name, motion.times, x) for name, x in signals.items()}
    body = builder.AddNamedSystem(
        "robot_visualizer", RobotVisualizer(robot.plant, robot.parts, meshcat, period)
    )
    builder.Connect(sources["positions"], body.GetInputPort("positions"))
    drawing = builder.AddNamedSystem(
        "path_visualizer", PathVisualizer(path, layout, meshcat, period)
    )
    builder.Connect(sources["tool_pose"], drawing.GetInputPort("tool_pose"))
    builder.Connect(sources["path_point"], drawing.GetInputPort("path_point"))
    return builder.Build()


def _aim_camera(path: Path, meshcat: Meshcat) -> None:
    """Look at robot and path from the side that the path is on."""
    points = path.position.derivatives(np.linspace(*path.position.domain, 100), 0)[:, 0, :]
    middle = points.mean(axis=0)
    reach = float(np.linalg.norm(points, axis=1).max())
    target = middle * np.array([0.5, 0.5, 0.7])
    meshcat.SetCameraPose(target + reach * np.array([0.6, -0.9, 0.35]), target)


def add_source(
    builder: DiagramBuilder, name: str, times: np.ndarray, samples: np.ndarray
) -> OutputPort:
    """Add a source that plays samples, linear in between, and return its output.

    Args:
        builder: Builder of the diagram.
        name: Name of the source.
        times: Times of the samples [s], shape (frames,).
        samples: Shape (frames, size).
    """
    trajectory = PiecewisePolynomial.FirstOrderHold(times, samples.T)
    return builder.AddNamedSystem(name, TrajectorySource(trajectory)).get_output_port()


def record(diagram: Diagram, meshcat: Meshcat, duration: float, period: float) -> str:
    """Play a replay diagram and return the recording as one self-contained page.

    Args:
        diagram: From :func:`build_replay`.
        meshcat: The same as there.
        duration: Length of the motion [s].
        period: Time between frames [s].
    """
    simulator = Simulator(diagram)
    meshcat.StartRecording(frames_per_second=1.0 / period, set_visualizations_while_recording=False)
    simulator.Initialize()
    simulator.AdvanceTo(duration)
    meshcat.PublishRecording()
    return meshcat.StaticHtml()
