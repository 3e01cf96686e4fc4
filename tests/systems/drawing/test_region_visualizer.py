"""Regions in Meshcat: where they are drawn, at rest and moving."""

import numpy as np
import pytest
from pydrake.geometry import Meshcat, MeshcatParams
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator

from pfsc_drake.systems.drawing.manifold_visualizer import RegionVisualizer
from pfsc_drake.systems.drawing.numbers import SceneNumber


@pytest.fixture(scope="module")
def meshcat():
    return Meshcat(MeshcatParams(host="localhost"))


def test_regions_are_drawn_and_one_moves_by_the_clock(meshcat):
    grid = np.stack(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.5], indexing="ij"), axis=-1)[:, :, 0]
    messages = []

    def placement(clock):
        messages.append(clock)
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
    assert set(messages) == {0.7}


class Scene:
    """Stands in for Meshcat, and remembers what was moved, hidden and shown."""

    def __init__(self):
        self.moved, self.seen = [], []

    def SetProperty(self, path, name, value, time):
        assert name == "visible"
        self.seen.append((path, value, time))

    def SetTransform(self, path, X, time=None):
        if time is not None:
            self.moved.append(path)

    def __getattr__(self, method):
        return lambda *arguments, **options: None


@pytest.mark.parametrize("position", [np.nan, 0.3])
@pytest.mark.parametrize("clock", [[], [0.7]])
def test_nothing_moves_without_a_clock_or_a_position(position, clock):
    scene = Scene()
    system = RegionVisualizer([], {0: lambda _: RigidTransform()}, 5, scene, 0.1)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.GetInputPort("manifold_point").FixValue(context, np.full(5, position))
    if clock:
        system.GetInputPort("region_clock").FixValue(context, clock)
    simulator.AdvanceTo(0.15)
    frame = ["fixtures/frame"] if np.isfinite(position) else []
    assert set(scene.moved) == {*frame, *(["fixtures/0"] if clock else [])}


def test_of_many_numbers_those_near_the_tool_are_shown():
    """Twelve squares in a row, the last of which comes to the tool."""
    scene, grid = Scene(), np.zeros((2, 2, 3))
    surfaces = [(grid + 0.1 * i * np.eye(3)[0], []) for i in range(12)]
    number = SceneNumber(1, np.zeros(3), np.array([1.0, 0.0, 0.0]), 0.1)
    coming = {11: lambda clock: RigidTransform([-1.1 * clock, 0.0, 0.0])}
    numbers = dict.fromkeys(range(12), number)
    system = RegionVisualizer(surfaces, coming, 3, scene, 0.1, numbers)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.GetInputPort("manifold_point").FixValue(context, np.zeros(3))
    clock = system.GetInputPort("region_clock").FixValue(context, [0.0])
    simulator.AdvanceTo(0.25)
    hidden = [(f"fixtures/{i}/number", False, 0.0) for i in range(8, 12)]
    assert sorted(scene.seen) == sorted(hidden)  # once, as nothing changes
    clock.GetMutableData().get_mutable_value().SetFromVector([1.0])
    simulator.AdvanceTo(0.35)
    changed = scene.seen[4:]
    assert [entry[:2] for entry in sorted(changed)] == [
        ("fixtures/11/number", True),
        ("fixtures/7/number", False),
    ]


def test_few_numbers_are_all_shown():
    scene, grid = Scene(), np.zeros((2, 2, 3))
    number = SceneNumber(1, np.zeros(3), np.array([1.0, 0.0, 0.0]), 0.1)
    system = RegionVisualizer([(grid, [])] * 8, {}, 3, scene, 0.1, dict.fromkeys(range(8), number))
    simulator = Simulator(system)
    system.GetInputPort("manifold_point").FixValue(simulator.get_mutable_context(), np.zeros(3))
    simulator.AdvanceTo(0.15)
    assert scene.seen == []
