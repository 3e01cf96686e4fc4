"""What plates, gripper, magazine and frame look like."""

import numpy as np
from pydrake.geometry import Box, Cylinder, Rgba
from pydrake.math import RigidTransform

from diagrams.drawing.mounting_drawing import MountingLook, ring_surface
from diagrams.scenario.plate import PlateParameters
from diagrams.surroundings.mounting import Mounting
from diagrams.surroundings.plate_plant import PAD, pin_shape
from pfsc_drake.geometry.bore import bore_wedges
from pfsc_drake.robot.delta.shapes import ACCENT, METAL
from pfsc_drake.systems.drawing.robot_visualizer import Surface
from pfsc_drake.systems.drawing.tool_visualizer import ToolPart

_FRAME, _MAGAZINE = Rgba(0.75, 0.72, 0.66, 1.0), Rgba(0.55, 0.62, 0.55, 1.0)
_CUP, _PLATE = Rgba(0.16, 0.17, 0.19, 1.0), Rgba(0.02, 0.53, 0.82, 0.85)
_CUP_RADIUS, _CUP_HEIGHT = 0.016, 0.03  # m
_BOARD, _BAR = 0.006, 0.02  # m


def mounting_look(mounting: Mounting) -> MountingLook:
    """Return how plates and what belongs to them are drawn.

    Args:
        mounting: Where magazine and frame stand.
    """
    plate = mounting.parameters
    height = plate.size[2]
    length, width = plate.frame.size
    under = mounting.X_WF @ RigidTransform([0.0, 0.0, height + plate.frame.depth + _BOARD / 2.0])
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
    return MountingLook(fixed, _bores(mounting), _gripper(plate), _plate(plate))


def _bores(mounting: Mounting) -> Surface:
    plate, vertices, triangles = mounting.parameters, [], []
    frame, count = plate.frame, 0
    radius = plate.pins.radius + frame.clearance / 2.0
    ring = ring_surface(bore_wedges(radius, frame.ring, frame.depth, frame.wedges))
    for x, y in plate.pins.positions:
        X_WG = mounting.X_WF @ RigidTransform([x, y, plate.size[2]])
        vertices.append(X_WG.multiply(ring.vertices.T).T)
        triangles.append(ring.triangles + count)
        count += len(ring.vertices)
    return Surface(np.concatenate(vertices), np.concatenate(triangles))


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
        parts.append(ToolPart(f"pin_{i}", pin, ACCENT, RigidTransform([x, y, depth])))
    return parts
