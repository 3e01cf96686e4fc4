"""Looking on while a robot is driven, on one bus with it."""

import json

import numpy as np
import pytest

from experiments.live.page_server import Pages
from experiments.live.status import LiveStatus
from experiments.live.watch import Watch, WatchPanel, run_watch
from experiments.scenario_file import read_scenario
from pfsc_drake.drivers.link import ObserverEndpoint
from pfsc_drake.drivers.messages import RobotMode, RobotStatus, dialect
from pfsc_drake.drivers.remote_values import Request
from pfsc_drake.errors import InputError
from tests.experiments.hardware.test_drive import Loop, panda

# what a loop in C tells
PROGRESS = ("time", "motion_time", "override", "stopping", "ended", "missed", "clipped")


class Frames:
    """A scene that keeps what it is given."""

    url = "http://127.0.0.1/"

    def __init__(self):
        self.seen = []

    def draw(self, frame, factor):
        self.seen.append(frame)


class Watched:
    """A robot that is driven, and who looks on."""

    def __init__(self):
        self.loop, self.pages, self.frames = Loop(panda()).begin(), Pages(), Frames()
        end = ObserverEndpoint(self.loop.end.lcm, self.loop.end.dialect)
        self.status = LiveStatus("pfc_panda_7r")
        self.panel = WatchPanel(self.pages)
        self.watch = Watch(
            self.loop.station, lambda first: self.frames, end, self.panel, self.status
        )

    def look(self):
        self.loop.end.publish_progress(1, self.loop.drive.progress())
        return self.watch.look(0.0)

    def set(self, name, value):
        self.pages.hear(json.dumps({"client": "me", "set": {name: value}}).encode())

    def heeded(self):
        self.loop.end.receive(0.0)
        for request in self.loop.end.requests():
            self.loop.drive.handle_request(request)


@pytest.fixture(scope="module")
def watched():
    found = Watched()
    found.loop.run(0.9)
    return found


def test_what_is_seen(watched):
    assert watched.look()
    status = watched.status
    assert status.phase == "driving"
    assert status.time == pytest.approx(0.9)
    assert list(status.deviation) == ["xi_1", "xi_2"]
    assert abs(status.deviation["xi_1"]) < 1e-4
    assert len(status.angles) == 3
    frame = watched.frames.seen[-1]
    # the robot as it told it, the path's point beside its tool
    layout = watched.loop.station.task.projected_manifold.layout
    on_path = frame.manifold_point[layout.position][:3]
    assert np.linalg.norm(frame.tool_pose[:3] - on_path) < 1e-4
    assert json.dumps(status.content(), allow_nan=False)


def test_a_loop_in_c_tells_no_coordinates(watched):
    """They are found from what the robot tells, and are those that the controller has."""
    progress = watched.loop.drive.progress()
    bare = {name: value for name, value in progress.items() if name in PROGRESS}
    watched.loop.end.publish_progress(2, bare)
    watched.watch.look(0.0)
    status = watched.status
    assert list(status.deviation) == ["xi_1", "xi_2"]
    assert list(status.progress) == ["eta"]
    assert len(status.angles) == 3
    for takes in (status.deviation, status.progress, status.angles):
        for name, value in takes.items():
            assert value == pytest.approx(progress[name], abs=1e-5), name
    assert status.progress["eta"] > 0.01


def test_the_page_slows_pauses_and_goes_on(watched):
    drive = watched.loop.drive
    watched.set("of planned speed", 0.42)
    watched.look()
    watched.heeded()
    assert drive.override == pytest.approx(0.4)
    watched.look()
    for expected in (0.0, 0.4):
        watched.set("pause, resume (space)", 1.0)
        watched.look()
        watched.heeded()
        assert drive.override == pytest.approx(expected)
        watched.look()
        assert watched.status.phase == ("driving" if expected else "paused")


def test_the_page_stops_the_robot_and_leaves(watched):
    watched.set("stop the robot (X)", 1.0)
    watched.look()
    watched.heeded()
    watched.look()
    assert watched.status.phase == "stopping"
    watched.set("leave (Q)", 1.0)
    watched.look()
    assert watched.panel.has_left


def test_nobody_drives_and_another_robot_is_there(watched):
    found = Watched()
    assert not found.watch.look(0.0)
    assert found.status.phase == "no controller"
    few = RobotStatus(1, np.zeros(6), np.zeros(6), np.zeros(6), RobotMode.MOVE)
    found.loop.robot_end.send_status(few)
    assert found.watch.look(0.0)
    assert not found.frames.seen
    lost = RobotStatus(1, np.full(7, np.nan), np.zeros(7), np.zeros(7), RobotMode.MOVE)
    found.loop.robot_end.send_status(lost)
    found.watch.look(0.0)
    assert not found.frames.seen


def test_what_the_panel_asks_for():
    panel = WatchPanel(pages := Pages())
    pages.hear(json.dumps({"client": "me", "set": {"of planned speed": 7.0}}).encode())
    assert panel.requests(1.0) == [Request(1.5)]
    assert panel.content(0.3)["sliders"][0]["value"] == 0.3


def test_a_bus_without_a_robot(monkeypatch):
    monkeypatch.setattr("experiments.live.watch._FIRST", 0.0)
    from pydrake.lcm import DrakeLcm

    end = ObserverEndpoint(DrakeLcm("memq://"), dialect("panda"))
    with pytest.raises(InputError, match="no status of a robot on PANDA_STATUS"):
        run_watch(read_scenario("pfc_panda_7r", []), end, port=0, notify=lambda line: None)
