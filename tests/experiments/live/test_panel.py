"""Sliders, keys, a gamepad and the page, and what they mean."""

from queue import SimpleQueue
from types import SimpleNamespace

import numpy as np
import pytest

from diagrams.surroundings.operator_file import columns
from experiments.live.controls import Slider, TunedParameter
from experiments.live.panel import Command, Panel

REGIONS = ["wall"]
NAMES = columns(REGIONS)
TOOL = np.array([0.8, 0.1, 0.9])
TUNED = [
    TunedParameter(1, Slider("along d", "tune", 4.5, 90.0, 0.5, 60.0)),
    TunedParameter(2, Slider("across k", "tune", 0.0, 2000.0, 10.0, 2000.0), top_is_rigid=True),
    TunedParameter(3, Slider("across d", "tune", 5.0, 600.0, 5.0, 150.0), always=True),
]


class Scene:
    """Stands in for Meshcat's panel, which needs a browser to be set."""

    def __init__(self):
        self.values, self.clicks, self.axes = {}, {}, []

    def AddSlider(self, name, low, high, step, value, down="", up=""):
        self.values[name] = value

    def AddButton(self, name, key):
        self.clicks[name] = 0

    def GetSliderValue(self, name):
        return self.values[name]

    def SetSliderValue(self, name, value):
        self.values[name] = value

    def GetButtonClicks(self, name):
        return self.clicks[name]

    def GetGamepad(self):
        return SimpleNamespace(axes=self.axes)


@pytest.fixture
def scene():
    return Scene()


@pytest.fixture
def clock():
    return SimpleNamespace(now=50.0)


@pytest.fixture
def requests():
    return SimpleQueue()


@pytest.fixture
def panel(scene, clock, requests):
    return Panel(scene, requests, 45.0, TUNED, REGIONS, lambda: clock.now)


def read(panel, place=TOOL):
    panel.look()
    return dict(zip(NAMES, panel.read(place).tolist(), strict=True))


def test_who_sets_nothing_asks_for_nothing(panel):
    controls = read(panel)
    assert controls.pop("region_wall") == 1.0
    assert controls.pop("transversal_damping") == 150.0  # what is rigid has none of its own
    assert {name for name, value in controls.items() if value == -1.0} == {
        name for name in NAMES if name.endswith(("stiffness", "damping"))
    } - {"transversal_damping"}
    assert not any(value for name, value in controls.items() if value != -1.0)


def test_pull_sliders_are_forces(panel, scene):
    scene.values["pull y [N]"] = -12.0
    assert read(panel)["push_y"] == -12.0


def test_a_key_pushes_for_a_while_and_again_while_it_repeats(panel, scene, clock):
    scene.values["key force [N]"] = 15.0
    scene.clicks["push -z (F)"] = 1
    assert read(panel)["push_z"] == -15.0
    clock.now += 0.5
    scene.clicks["push -z (F)"] = 2
    assert read(panel)["push_z"] == -15.0
    clock.now += 0.5
    assert read(panel)["push_z"] == -15.0
    clock.now += 0.2
    assert read(panel)["push_z"] == 0.0


def test_a_key_that_is_released_on_the_page_pushes_no_more(panel, requests):
    requests.put(("push +x (W)", 1.0))
    assert read(panel)["push_x"] == 20.0
    requests.put(("push +x (W)", 0.0))
    assert read(panel)["push_x"] == 0.0


def test_the_page_sets_the_scene(panel, scene, requests):
    requests.put(("pull x [N]", 7.0))
    requests.put(("no such slider", 1.0))
    assert read(panel)["push_x"] == 7.0
    assert scene.values["pull x [N]"] == 7.0
    values = {slider["name"]: slider["value"] for slider in panel.content()["sliders"]}
    assert values["pull x [N]"] == 7.0


def test_sticks_push_forward_left_and_up(panel, scene):
    scene.axes = [-1.0, 0.05, 0.0, -0.56]
    controls = read(panel)
    assert [controls[f"push_{axis}"] for axis in "xyz"] == pytest.approx([0.0, 45.0, 22.5])


def test_a_hand_takes_hold_where_the_tool_is(panel, scene):
    scene.values |= {"hold (T, G)": 1.0, "hold dx [m]": 0.1}
    controls = read(panel)
    assert controls["hold"] == 1.0
    assert [controls[f"target_{axis}"] for axis in "xyz"] == TOOL.tolist()
    scene.values["hold dx [m]"] = 0.1
    controls = read(panel, TOOL + 0.05)
    assert controls["target_x"] == pytest.approx(0.9)
    assert controls["target_y"] == pytest.approx(0.1)
    scene.clicks[Command.LET_GO.value[0]] = 1
    panel.look()
    assert panel.commands() == [Command.LET_GO]
    assert read(panel)["hold"] == 0.0
    assert panel.commands() == []


def test_a_slider_counts_when_it_is_moved_and_its_top_is_rigid(panel, scene):
    scene.values |= {"across k": 500.0, "along d": 80.0}
    controls = read(panel)
    assert controls["transversal_stiffness"] == 500.0
    assert controls["tangential_damping"] == 80.0
    scene.values |= {"across k": 2000.0, "along d": 60.0}
    controls = read(panel)
    assert controls["transversal_stiffness"] == -1.0
    assert controls["tangential_damping"] == -1.0


def test_without_guidance_it_moves_across_as_it_does_along(panel, scene):
    scene.values["guide (K, J)"] = 0.0
    controls = read(panel)
    assert controls["transversal_stiffness"] == 0.0
    assert controls["transversal_damping"] == 60.0


def test_regions_are_switched(panel, scene):
    scene.values["region wall"] = 0.0
    assert read(panel)["region_wall"] == 0.0


def test_commands_are_told_once(panel, scene, requests):
    scene.clicks[Command.RESET.value[0]] = 1
    requests.put((Command.RECORD.value[0], 1.0))
    panel.look()
    assert set(panel.commands()) == {Command.RESET, Command.RECORD}
    panel.look()
    assert panel.commands() == []
