"""Plates and gripper in a replay."""

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from diagrams.drawing.mounting_drawing import (
    MountingDrawing,
    ring_surface,
)
from diagrams.environment.mounting import Mounting
from diagrams.scenario.plate import PlateParameters
from pfsc_drake.geometry.workpiece_bodies import bore_wedges

X_WM, X_WF = RigidTransform([0.7, -0.4, 0.5]), RigidTransform([0.8, 0.3, 0.6])
DOWN = RotationMatrix.MakeXRotation(np.pi)


def test_a_ring_is_as_large_as_its_bore():
    """Areas of what is seen: twice its upper face and its walls, for either side of a face."""
    radius, outer, depth, count = 4e-3, 16e-3, 1e-2, 24
    surface = ring_surface(bore_wedges(radius, outer, depth, count))
    a, b, c = (surface.vertices[surface.triangles[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0
    side = 2.0 * np.tan(np.pi / count)
    top = count * side * (outer**2 - radius**2) / 2.0
    walls = count * side * (outer + radius) * depth
    assert abs(area - 2.0 * (2.0 * top + walls)) < 1e-9


def test_everything_is_drawn_where_it_is():
    look = MountingDrawing(Mounting(PlateParameters(), X_WM, X_WF))
    middle = look.bores.vertices.reshape(4, -1, 3).mean(axis=(0, 1))
    np.testing.assert_allclose(middle[:2], X_WF.translation()[:2], atol=1e-9)
    names = {part.name for part in look.fixed}
    assert {"frame", "magazine", "frame_rest_0", "magazine_rest_3"} <= names
    meshcat, builder = Meshcat(MeshcatParams(host="localhost")), DiagramBuilder()
    poses = [np.array([*p, *np.eye(3).ravel()]) for p in ([0, 0, 1], [1, 0, 0], [0, 2, 0])]
    tool, *plates = (
        builder.AddSystem(ConstantVectorSource(pose)).get_output_port() for pose in poses
    )
    look.add(builder, tool, plates, meshcat, 0.1)
    simulator = Simulator(builder.Build())
    simulator.Initialize()
    for name in ("bores", "frame", "magazine", "gripper/cup_0", "plate_1/pin_3", "plate_2/board"):
        assert meshcat.HasPath(f"/drake/mounting/{name}")
