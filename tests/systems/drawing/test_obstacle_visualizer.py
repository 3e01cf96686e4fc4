"""Obstacles in Meshcat: shapes and positions."""

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams

from pfsc_drake.control.obstacles.shapes import Capsule, ObstacleShape
from pfsc_drake.systems.drawing.obstacle_visualizer import ObstacleVisualizer


def test_persons_and_spheres_are_where_they_should_be():
    meshcat = Meshcat(MeshcatParams(host="localhost"))
    beam = Capsule((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), 0.05), Capsule((0, 0, 0), (0, 0, 0), 0.1)
    shapes = [ObstacleShape("column", 0.25), ObstacleShape("sphere", 0.1)]
    shapes.append(ObstacleShape("capsules", 0.1, capsules=beam))
    visualizer = ObstacleVisualizer(shapes, 0.15, meshcat, 0.032)
    context = visualizer.CreateDefaultContext()
    positions = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0])
    visualizer.GetInputPort("positions").FixValue(context, positions)
    visualizer.ForcedPublish(context)
    visualizer._begin(context)
    for path in (
        "0/body",
        "0/head",
        "0/room",
        "0/margin",
        "1/body",
        "1/margin",
        "2/body_0",
        "2/margin_1",
    ):
        assert meshcat.HasPath(f"/drake/obstacles/{path}")
    # a person stands on the floor
    assert meshcat.HasPath("/drake/obstacles/0")
    assert not meshcat.HasPath("/drake/obstacles/3")
