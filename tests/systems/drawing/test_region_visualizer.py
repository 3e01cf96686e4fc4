"""Regions in Meshcat: where they are drawn, at rest and moving."""

import numpy as np
import pytest
from pydrake.geometry import Meshcat, MeshcatParams
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator

from pfsc_drake.systems.drawing.manifold_visualizer import RegionVisualizer


@pytest.fixture(scope="module")
def meshcat():
    return Meshcat(MeshcatParams(host="localhost"))


def test_regions_are_drawn_and_one_moves_by_the_clock(meshcat):
    grid = np.stack(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.5], indexing="ij"), axis=-1)[:, :, 0]
    told = []

    def placement(clock):
        told.append(clock)
        return RigidTransform([clock, 0.0, 0.0])

    system = RegionVisualizer([(grid, [grid[0]])] * 2, {1: placement}, 9, meshcat, 0.1)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.GetInputPort("manifold_point").FixValue(context, np.full(9, 0.3))
    system.GetInputPort("region_clock").FixValue(context, [0.7])
    meshcat.StartRecording()
    simulator.AdvanceTo(0.25)
    meshcat.StopRecording()
    for i in (0, 1):
        assert meshcat.HasPath(f"/drake/fixtures/{i}/skin")
    assert meshcat.HasPath("/drake/fixtures/frame")
    assert set(told) == {0.7}


class Scene:
    """Stands in for Meshcat, and remembers what was moved."""

    def __init__(self):
        self.moved = []

    def SetTransform(self, path, X, time=None):
        if time is not None:
            self.moved.append(path)

    def __getattr__(self, method):
        return lambda *arguments, **options: None


@pytest.mark.parametrize("place", [np.nan, 0.3])
@pytest.mark.parametrize("clock", [[], [0.7]])
def test_nothing_moves_without_a_clock_or_a_place(place, clock):
    scene = Scene()
    system = RegionVisualizer([], {0: lambda _: RigidTransform()}, 5, scene, 0.1)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.GetInputPort("manifold_point").FixValue(context, np.full(5, place))
    if clock:
        system.GetInputPort("region_clock").FixValue(context, clock)
    simulator.AdvanceTo(0.15)
    frame = ["fixtures/frame"] if np.isfinite(place) else []
    assert set(scene.moved) == {*frame, *(["fixtures/0"] if clock else [])}
