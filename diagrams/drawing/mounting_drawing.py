"""Drawing of plates, gripper, magazine and frame."""

import numpy as np
from pydrake.geometry import Box, Cylinder, Meshcat, Rgba
from pydrake.math import RigidTransform
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.environment.mounting import PAD, Mounting, pin_shape
from diagrams.scenario.plate import PlateParameters
from pfsc_drake.geometry.workpiece_bodies import bore_wedges
from pfsc_drake.robot.delta.shapes import METAL
from pfsc_drake.systems.drawing.robot_visualizer import Triangles
from pfsc_drake.systems.drawing.tool_visualizer import ToolPart, ToolVisualizer

_FRAME, _MAGAZINE = Rgba(0.75, 0.72, 0.66, 1.0), Rgba(0.55, 0.62, 0.55, 1.0)
_CUP, _PLATE = Rgba(0.16, 0.17, 0.19, 1.0), Rgba(0.02, 0.53, 0.82, 0.6)
_PIN = Rgba(0.9, 0.35, 0.05, 1.0)
_CUP_RADIUS, _CUP_HEIGHT = 0.016, 0.03  # m
_BOARD, _BAR = 0.006, 0.02  # m
_BORE = Rgba(0.45, 0.47, 0.50, 0.35)  # transparent, to show a pin inside


class MountingDrawing:
    """Drawing of plates, gripper, magazine and frame.

    Args:
        mounting: Plates, with the poses of magazine and frame.

    Attributes:
        fixed: Parts fixed to the world.
        bores: Rings around the bores, world axes.
        gripper: Parts that move with the tool.
        plate: Parts that move with each plate.
    """

    def __init__(self, mounting: Mounting) -> None:
        plate = mounting.parameters
        height = plate.size[2]
        length, width = plate.frame.size
        under = mounting.X_WF @ RigidTransform(
            [0.0, 0.0, height + plate.frame.depth + _BOARD / 2.0]
        )
        shelf = mounting.X_WM @ RigidTransform(
            [0.0, 0.0, height + max(PAD[1], plate.pins.length) + _BOARD / 2.0]
        )
        fixed = [
            ToolPart("frame", Box(length, width, _BOARD), _FRAME, under),
            ToolPart("magazine", Box(length, width, _BOARD), _MAGAZINE, shelf),
        ]
        for name, X_WC, color in (
            ("frame", mounting.X_WF, _FRAME),
            ("magazine", mounting.X_WM, _MAGAZINE),
        ):
            for i, (x, y) in enumerate(plate.rests):
                X_WG = X_WC @ RigidTransform([x, y, height + PAD[1] / 2.0])
                fixed.append(ToolPart(f"{name}_rest_{i}", Box(PAD[0], PAD[0], PAD[1]), color, X_WG))
        self.fixed, self.bores = fixed, _bores(mounting)
        self.gripper, self.plate = _gripper(plate), _plate(plate)

    def add(
        self,
        builder: DiagramBuilder,
        tool_pose: OutputPort,
        plates: list[OutputPort],
        meshcat: Meshcat,
        period: float,
    ) -> None:
        """Draw magazine and frame, and the motion of gripper and plates.

        Args:
            builder: Builder of the replay.
            tool_pose: ``[y_t, R_e by rows]``, shape (12,).
            plates: Pose of each plate, likewise.
            meshcat: Meshcat instance to draw in.
            period: Time between frames [s].
        """
        vertices, triangles = self.bores.vertices.T, self.bores.triangles.T
        meshcat.SetTriangleMesh("mounting/bores", vertices, triangles, _BORE)
        for part in self.fixed:
            meshcat.SetObject(f"mounting/{part.name}", part.shape, part.color)
            meshcat.SetTransform(f"mounting/{part.name}", part.X_TP)
        moving = {"gripper": (self.gripper, tool_pose)}
        moving |= {f"plate_{k + 1}": (self.plate, port) for k, port in enumerate(plates)}
        for name, (parts, pose) in moving.items():
            system = builder.AddNamedSystem(
                f"{name}_visualizer", ToolVisualizer(parts, meshcat, period, f"mounting/{name}")
            )
            builder.Connect(pose, system.GetInputPort("tool_pose"))


def _bores(mounting: Mounting) -> Triangles:
    plate, vertices, triangles = mounting.parameters, [], []
    frame, count = plate.frame, 0
    radius = plate.pins.radius + frame.clearance / 2.0
    ring = ring_surface(bore_wedges(radius, frame.ring, frame.depth, frame.wedges))
    for x, y in plate.pins.positions:
        X_WG = mounting.X_WF @ RigidTransform([x, y, plate.size[2]])
        vertices.append(X_WG.multiply(ring.vertices.T).T)
        triangles.append(ring.triangles + count)
        count += len(ring.vertices)
    return Triangles(np.concatenate(vertices), np.concatenate(triangles))


def _gripper(plate: PlateParameters) -> list[ToolPart]:
    parts = []
    for i, (x, y) in enumerate(plate.suction.cups):
        X_TP = RigidTransform([x, y, -_CUP_HEIGHT / 2.0])
        parts.append(ToolPart(f"cup_{i}", Cylinder(_CUP_RADIUS, _CUP_HEIGHT), _CUP, X_TP))
    span = 2.0 * np.abs(np.array(plate.suction.cups)).max(axis=0)
    bar = RigidTransform([0.0, 0.0, -_CUP_HEIGHT - _BAR / 2.0])
    return [*parts, ToolPart("bar", Box(*span, _BAR), METAL, bar)]


def _plate(plate: PlateParameters) -> list[ToolPart]:
    middle = RigidTransform([0.0, 0.0, plate.size[2] / 2.0])
    parts = [ToolPart("board", Box(*plate.size), _PLATE, middle)]
    pin, depth = pin_shape(plate)
    for i, (x, y) in enumerate(plate.pins.positions):
        parts.append(ToolPart(f"pin_{i}", pin, _PIN, RigidTransform([x, y, depth])))
    return parts


def ring_surface(wedges: np.ndarray) -> Triangles:
    """Return the visible faces of a ring of wedges.

    Args:
        wedges: Corners from :func:`bore_wedges`, shape (count, 8, 3).
    """
    # corners: bit 2 outside, bit 1 side, bit 0 bottom; both orders, to be seen from both sides
    quads = np.array([[0, 2, 6, 4], [0, 1, 3, 2], [4, 6, 7, 5], [1, 5, 7, 3]])
    pairs = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    triangles = np.concatenate([pairs, pairs[:, ::-1]])
    offsets = 8 * np.arange(len(wedges))[:, np.newaxis, np.newaxis]
    return Triangles(wedges.reshape(-1, 3), (offsets + triangles).reshape(-1, 3))
