"""The past path of a point, piece by piece."""

import numpy as np
from pydrake.geometry import Rgba
from pydrake.systems.analysis import Simulator

from pfsc_drake.systems.drawing.tool_visualizer import TrailVisualizer


class Scene:
    """Stands in for Meshcat: the last line by name."""

    def __init__(self):
        self.lines = {}

    def SetLine(self, name, ends, width, color):
        self.lines[name] = ends.T.tolist()

    def SetProperty(self, *arguments):
        pass


def test_the_last_pieces_of_a_long_path_stay():
    scene = Scene()
    system = TrailVisualizer("way", Rgba(1.0, 0.0, 0.0), scene, 1.0, longest=3)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    points = np.outer(np.arange(8.0), [1.0, 0.0, 0.0])
    for time, point in enumerate(points):
        system.GetInputPort("point").FixValue(context, point)
        simulator.AdvanceTo(float(time)) if time else simulator.Initialize()
        simulator.AdvanceTo(time + 0.5)  # when it is remembered
    assert len(scene.lines) == 3
    pieces = sorted(scene.lines.values())
    assert pieces == [[points[i].tolist(), points[i + 1].tolist()] for i in (4, 5, 6)]
