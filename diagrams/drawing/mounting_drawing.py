"""Plates, gripper, magazine and frame, in the replay of any robot."""

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Meshcat, Rgba
from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.systems.drawing.robot_visualizer import Surface
from pfsc_drake.systems.drawing.tool_visualizer import ToolPart, ToolVisualizer

_BORE = Rgba(0.45, 0.47, 0.50, 1.0)


@dataclass(frozen=True)
class MountingLook:
    """How plates and what belongs to them are drawn.

    Attributes:
        fixed: What stands in the world.
        bores: Rings around the bores, world axes.
        gripper: What moves with the tool.
        plate: What moves with each plate.
    """

    fixed: list[ToolPart]
    bores: Surface
    gripper: list[ToolPart]
    plate: list[ToolPart]


def add_mounting_drawing(
    builder: DiagramBuilder,
    look: MountingLook,
    tool_pose: OutputPort,
    plates: list[OutputPort],
    meshcat: Meshcat,
    period: float,
) -> None:
    """Draw magazine and frame, and let gripper and plates move.

    Args:
        builder: Builder of the replay.
        look: How they are drawn.
        tool_pose: ``[y_t, R_e by rows]``, shape (12,).
        plates: The same of each plate.
        meshcat: Where to draw.
        period: Time between frames [s].
    """
    vertices, triangles = look.bores.vertices.T, look.bores.triangles.T
    meshcat.SetTriangleMesh("mounting/bores", vertices, triangles, _BORE)
    for part in look.fixed:
        meshcat.SetObject(f"mounting/{part.name}", part.shape, part.color)
        meshcat.SetTransform(f"mounting/{part.name}", part.X_TP)
    moving = {"gripper": (look.gripper, tool_pose)}
    moving |= {f"plate_{k + 1}": (look.plate, port) for k, port in enumerate(plates)}
    for name, (parts, pose) in moving.items():
        system = builder.AddNamedSystem(
            f"{name}_visualizer", ToolVisualizer(parts, meshcat, period, f"mounting/{name}")
        )
        builder.Connect(pose, system.GetInputPort("tool_pose"))


def ring_surface(wedges: np.ndarray) -> Surface:
    """Return the faces of a ring of wedges that can be seen.

    Args:
        wedges: Corners as :func:`bore_wedges` gives them, shape (count, 8, 3).
    """
    # corners: bit 2 outside, bit 1 side, bit 0 bottom; both orders, to be seen from both sides
    quads = np.array([[0, 2, 6, 4], [0, 1, 3, 2], [4, 6, 7, 5], [1, 5, 7, 3]])
    pairs = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    triangles = np.concatenate([pairs, pairs[:, ::-1]])
    offsets = 8 * np.arange(len(wedges))[:, np.newaxis, np.newaxis]
    return Surface(wedges.reshape(-1, 3), (offsets + triangles).reshape(-1, 3))
