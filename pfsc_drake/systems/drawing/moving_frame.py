"""The moving frame of a manifold in Meshcat."""

import numpy as np
from pydrake.geometry import Cylinder, Meshcat, Rgba
from pydrake.math import RigidTransform, RotationMatrix

_AXIS_COLORS = (Rgba(0.85, 0.1, 0.1), Rgba(0.1, 0.65, 0.2), Rgba(0.1, 0.25, 0.9))
_AXIS_LENGTH, _AXIS_RADIUS = 0.08, 0.003


def draw_frame(meshcat: Meshcat, place: str) -> None:
    """Draw a frame at a place of the scene tree; its axes are red, green and blue.

    Args:
        meshcat: Where to draw.
        place: Path of the frame, which can then be moved.
    """
    for i, color in enumerate(_AXIS_COLORS):
        direction = np.eye(3)[i]
        X_FA = RigidTransform(
            RotationMatrix.MakeFromOneVector(direction, 2), direction * _AXIS_LENGTH / 2
        )
        axis = f"{place}/axis_{i}"
        meshcat.SetObject(axis, Cylinder(_AXIS_RADIUS, _AXIS_LENGTH), color)
        meshcat.SetTransform(axis, X_FA)
