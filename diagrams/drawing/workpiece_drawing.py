"""A workpiece and what touches it, in the replay of any robot."""

import numpy as np
from pydrake.geometry import Meshcat, Rgba
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.workpiece import WorkpieceLook
from pfsc_drake.systems.drawing.tool_visualizer import ToolVisualizer

_WORKPIECE = Rgba(0.75, 0.72, 0.66, 0.75)
_VIEW = np.array([0.5, -0.4, 0.35])  # m, from the workpiece to the camera, z upwards


def add_workpiece_drawing(
    builder: DiagramBuilder,
    look: WorkpieceLook,
    tool_pose: OutputPort,
    meshcat: Meshcat,
    period: float,
) -> None:
    """Draw a workpiece, and let what touches it move with the tool.

    Args:
        builder: Builder of the replay.
        look: How they are drawn.
        tool_pose: ``[y_t, R_e]``.
        meshcat: Where to draw, axes of the inertial frame.
        period: Time between frames [s].
    """
    draw_workpiece(look, meshcat)
    tool = builder.AddNamedSystem(
        "tool_visualizer", ToolVisualizer(look.tool_parts, meshcat, period)
    )
    builder.Connect(tool_pose, tool.GetInputPort("tool_pose"))


def draw_workpiece(look: WorkpieceLook, meshcat: Meshcat) -> None:
    """Draw a workpiece.

    Args:
        look: How it is drawn.
        meshcat: Where to draw, axes of the inertial frame.
    """
    surface = look.surface
    meshcat.SetTriangleMesh("workpiece", surface.vertices.T, surface.triangles.T, _WORKPIECE)


def look_down_at(meshcat: Meshcat, target: np.ndarray) -> None:
    """Turn the camera to a workpiece.

    Args:
        meshcat: Whose camera it is.
        target: Where the workpiece is [m], shape (3,), z upwards.
    """
    meshcat.SetCameraPose(target + _VIEW, target)
