"""Sliders, keys, a gamepad and the page, and what they mean."""

import base64
import json
import os
import socket
import time
from contextlib import closing
from types import SimpleNamespace
from urllib.parse import urlsplit

import numpy as np
import pytest

from diagrams.environment.operator import columns
from experiments.live.controls import Slider, TunedParameter
from experiments.live.page_server import Pages
from experiments.live.panel import Command, Panel, Scene

REGIONS = ["wall"]
NAMES = columns(REGIONS)
TOOL = np.array([0.8, 0.1, 0.9])
TUNED = [
    TunedParameter(1, Slider("along d", "tune", 4.5, 90.0, 0.5, 60.0)),
    TunedParameter(2, Slider("across k", "tune", 0.0, 2000.0, 10.0, 2000.0), top_is_rigid=True),
    TunedParameter(3, Slider("across d", "tune", 5.0, 600.0, 5.0, 150.0), always=True),
]


@pytest.fixture
def clock():
    return SimpleNamespace(now=50.0)


@pytest.fixture
def pages(clock):
    return Pages(lambda: clock.now)


@pytest.fixture
def panel(pages):
    return Panel(pages, 45.0, TUNED, REGIONS)


def say(pages, hand=None, **settings):
    message = {"client": "a", "hand": hand or {}, "set": settings}
    assert pages.hear(json.dumps(message).encode())


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


def test_handles_are_forces_that_end_where_the_hand_does(panel, pages):
    say(pages, {"pull y [N]": -12.0, "pull x [N]": 1e300})
    controls = read(panel)
    assert controls["push_y"] == -12.0
    assert controls["push_x"] == 45.0
    assert panel.content()["hand"]["pull y [N]"] == -12.0


def test_a_key_pushes_as_long_as_it_is_held(panel, pages, clock):
    say(pages, {"push -z (F)": 1.0}, **{"key force [N]": 15.0})
    assert read(panel)["push_z"] == -15.0
    clock.now += 0.2
    assert read(panel)["push_z"] == -15.0
    say(pages)
    assert read(panel)["push_z"] == 0.0


def test_sticks_push_forward_left_and_up(panel, pages):
    say(pages, {"stick x": -0.05, "stick y": 7.0, "stick z": 0.56})
    controls = read(panel)
    assert [controls[f"push_{axis}"] for axis in "xyz"] == pytest.approx([0.0, 45.0, 22.5])


def test_a_hand_that_is_silent_has_let_go_of_everything(panel, pages, clock):
    say(pages, {"pull x [N]": 22.0}, **{"hold (T, G)": 1.0, "across k": 500.0})
    controls = read(panel)
    assert controls["push_x"] == 22.0
    assert controls["hold"] == 1.0
    clock.now += 0.31
    controls = read(panel)
    assert controls["push_x"] == 0.0
    assert controls["hold"] == 0.0
    assert controls["transversal_stiffness"] == 500.0
    say(pages, {"pull x [N]": 22.0})
    controls = read(panel)
    assert controls["push_x"] == 22.0
    assert controls["hold"] == 0.0


def test_a_device_is_dragged_from_where_the_hand_took_hold_of_it(pages, clock):
    panel = Panel(pages, 45.0, TUNED, REGIONS, drags=True)
    assert panel.content()["drag"] == 0.15
    say(pages, {"drag y [m]": 0.05})
    controls = read(panel)
    assert controls["hold"] == 1.0
    assert [controls[f"target_{axis}"] for axis in "xyz"] == pytest.approx([0.8, 0.15, 0.9])
    say(pages, {"drag y [m]": 0.1, "drag z [m]": -7.0})
    controls = read(panel, TOOL + 0.02)  # the tool has moved meanwhile
    assert [controls[f"target_{axis}"] for axis in "xyz"] == pytest.approx([0.8, 0.2, 0.6])
    assert [controls[f"push_{axis}"] for axis in "xyz"] == [0.0, 0.0, 0.0]
    say(pages)
    assert read(panel)["hold"] == 0.0
    say(pages, {"drag x [m]": 0.01})
    assert read(panel, TOOL + 0.02)["target_x"] == pytest.approx(TOOL[0] + 0.03)
    clock.now += 0.31
    assert read(panel)["hold"] == 0.0


def test_a_tool_at_hand_is_pulled(panel):
    assert panel.content()["drag"] is None


def test_a_hand_takes_hold_where_the_tool_is(panel, pages):
    say(pages, **{"hold dx [m]": 0.1, "hold (T, G)": 1.0})
    controls = read(panel)
    assert controls["hold"] == 1.0
    assert [controls[f"target_{axis}"] for axis in "xyz"] == TOOL.tolist()
    say(pages, **{"hold dx [m]": 0.1})
    controls = read(panel, TOOL + 0.05)
    assert controls["target_x"] == pytest.approx(0.9)
    assert controls["target_y"] == pytest.approx(0.1)
    say(pages, {"pull x [N]": 7.0}, **{Command.LET_GO.value[0]: 1})
    panel.look()
    assert panel.commands() == [Command.LET_GO]
    controls = read(panel)
    assert controls["hold"] == 0.0
    assert controls["push_x"] == 0.0  # until it is heard again
    assert panel.commands() == []


def test_a_slider_counts_when_it_is_moved_and_its_top_is_rigid(panel, pages):
    say(pages, **{"across k": 500.0, "along d": 80.0})
    controls = read(panel)
    assert controls["transversal_stiffness"] == 500.0
    assert controls["tangential_damping"] == 80.0
    say(pages, **{"across k": 2000.0, "along d": 60.0})
    controls = read(panel)
    assert controls["transversal_stiffness"] == -1.0
    assert controls["tangential_damping"] == -1.0


def test_a_slider_stays_on_its_scale(panel, pages):
    values = {"across k": 1e300, "along d": -3.0, "across d": 152.4}
    say(pages, **values)
    panel.look()
    shown = {slider["name"]: slider["value"] for slider in panel.content()["sliders"]}
    assert [shown[name] for name in values] == [2000.0, 4.5, 150.0]


def test_without_guidance_it_moves_across_as_it_does_along(panel, pages):
    say(pages, **{"guide (K, J)": 0.0})
    controls = read(panel)
    assert controls["transversal_stiffness"] == 0.0
    assert controls["transversal_damping"] == 60.0


def test_regions_are_switched(panel, pages):
    say(pages, **{"region wall": 0.0})
    assert read(panel)["region_wall"] == 0.0


def test_commands_are_told_once(panel, pages):
    say(pages, **{Command.RESET.value[0]: 1, Command.RECORD.value[0]: 1, Command.END.value[0]: 0})
    panel.look()
    assert set(panel.commands()) == {Command.RESET, Command.RECORD}
    panel.look()
    assert panel.commands() == []


class View:
    """Draws nothing but a property."""

    def __init__(self, first, meshcat):
        self.drawn, self._meshcat = [first], meshcat

    def draw(self, frame, *, interrupted):
        self.drawn.append(frame)
        self._meshcat.SetProperty("thing", "visible", True)


def send(url, payload):
    """Send a binary message of less than 126 bytes to a WebSocket, as a page of any origin can."""
    place = urlsplit(url)
    with closing(socket.create_connection((place.hostname, place.port), timeout=5)) as stranger:
        key = base64.b64encode(os.urandom(16)).decode()
        stranger.sendall(
            f"GET / HTTP/1.1\r\nHost: {place.netloc}\r\nOrigin: http://elsewhere.example\r\n"
            f"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: {key}\r\n"
            "Sec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        assert b"101" in stranger.recv(4096)
        stranger.sendall(bytes([0x82, 0x80 | len(payload), 0, 0, 0, 0]) + payload)
        time.sleep(0.1)


def draw_until(scene, condition):
    """Draw frames, until a condition holds."""
    end = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < end
        scene.draw("frame", 1.0)
        time.sleep(0.01)


@pytest.mark.parametrize("payload", [b"", b"\xdd\xff\xff\xff\xff\0\0"], ids=["empty", "huge"])
def test_who_ends_it_ends_nothing_but_the_scene(payload):
    views, said = [], []

    def view(first, meshcat):
        views.append(View(first, meshcat))
        return views[-1]

    scene = Scene(view, "first", said.append)
    first = scene.url
    scene.draw("frame", 1.0)
    send(first, payload)
    draw_until(scene, lambda: scene.url != first)
    assert len(said) == 1
    assert views[1].drawn[0] == "frame"
    scene.draw("next", 1.0)
    assert views[1].drawn[-1] == "next"


def test_after_many_ends_it_draws_no_more_and_says_so():
    class Broken(View):
        def draw(self, frame, *, interrupted):
            raise RuntimeError

    said = []
    scene = Scene(Broken, "first", said.append)
    for _ in range(20):
        scene.draw("frame", 1.0)
    assert len(said) == 11
    assert "no longer" in said[-1]
