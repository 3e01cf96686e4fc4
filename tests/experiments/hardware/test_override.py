"""Slower, faster, a pause and a stop while a robot is driven, by requests and by keys."""

import os
import pty
import sys
from pathlib import Path

import numpy as np
import pytest

from experiments.hardware.drive import Drive
from experiments.hardware.keys import DriveKeys, pressed_keys
from pfsc_drake.drivers.driver_rules import DriverOptions
from pfsc_drake.drivers.link import ObserverEndpoint
from pfsc_drake.drivers.remote_values import (
    LARGEST_OVERRIDE,
    Request,
    decode_values,
    encode_values,
)
from tests.experiments.hardware.test_drive import Loop, panda


@pytest.fixture(scope="module")
def changed():
    """A robot at full pace, at half of it, in a pause, and on its way again."""
    loop = Loop(panda()).begin().run(0.9)
    for request in (Request(0.5), Request(0.0), Request(1.2)):
        loop.drive.handle_request(request)
        loop.run(loop.drive.time + 0.6)
    return loop


@pytest.mark.slow
def test_the_pace_is_what_was_asked_for_and_the_path_is_not_left(changed):
    log = changed.log()
    t, speed = log.time, log["eta_dot"].values[:, 0]
    # at full speed, the filter of the override settled, a pause, faster than planned
    np.testing.assert_allclose(speed[(t > 0.85) & (t < 0.9)], 0.4, atol=0.02)
    np.testing.assert_allclose(speed[(t > 1.4) & (t < 1.5)], 0.2, atol=2e-3)
    assert np.abs(speed[(t > 2.0) & (t < 2.1)]).max() < 1e-3
    np.testing.assert_allclose(speed[-20:], 0.48, atol=0.02)
    assert changed.fault is None
    assert np.abs(log["xi"].values[t > 0.6]).max() < 3e-5
    np.testing.assert_array_equal(
        log["override"].values[[100, 1000, 1600, 2200], 0], [1, 0.5, 0, 1.2]
    )


@pytest.mark.slow
def test_an_override_from_the_start_is_the_same_motion_slower():
    loop = Loop(panda())
    loop.drive = Drive(loop.station, loop.end, 0.5)
    slow = loop.begin().run(1.6).log()
    motion = loop.station.task.motion.derivatives(0.5 * slow.time, 1)[:, :, 0]
    np.testing.assert_allclose(slow["eta_p"].values[:, 0], motion[:, 0], atol=1e-9)
    settled = slow.time > 0.6
    np.testing.assert_allclose(
        slow["eta_dot"].values[settled, 0], 0.5 * motion[settled, 1], atol=1e-3
    )
    assert motion[-1, 0] > 0.08
    assert np.abs(slow["xi"].values[settled]).max() < 2e-5


@pytest.mark.slow
def test_a_pause_costs_time_and_not_the_motion(changed):
    log = changed.log()
    paces = np.interp(
        log.time, [0.9, 0.9 + 1e-9, 1.5, 1.5 + 1e-9, 2.1, 2.1 + 1e-9], [1, 0.5, 0.5, 0, 0, 1.2]
    )
    # a filter of order 2 at 20 1/s comes 0.1 s later
    lag = 0.1 * (1.0 - 1.2)
    assert abs(changed.drive.motion_time - paces.mean() * changed.drive.time - lag) < 5e-3


@pytest.mark.slow
def test_a_motion_is_made_no_faster_than_drives_allow():
    settings = panda()
    settings.reference.velocity, settings.reference.acceleration = 3.0, 60.0
    loop = Loop(settings)
    plan = loop.station.task.drive_plan
    loop.drive.handle_request(Request(1.5))
    assert 1.0 < loop.drive.override < 1.2
    share = np.abs(plan.demand).max(axis=0) / plan.limits
    torques, speeds = share[:7].max(), share[7:].max()
    assert loop.drive.override == pytest.approx(min((0.95 / torques) ** 0.5, 0.95 / speeds))
    assert plan.largest_scaling(4) == pytest.approx(min((0.95 / torques) ** 0.25, 0.95 / speeds))


@pytest.mark.slow
def test_who_watches_is_told_and_may_stop_the_robot():
    loop = Loop(panda()).begin()
    watching = ObserverEndpoint(loop.end.lcm, loop.end.dialect)
    loop.run(0.9)
    loop.end.publish_progress(1, loop.drive.progress())
    assert watching.receive(0.0).q.shape == (7,)
    told = watching.progress
    assert (told["override"], told["stopping"]) == (1.0, 0.0)
    assert told["time"] == pytest.approx(0.9)
    assert abs(told["xi_1"]) < 2e-5
    watching.send_request(Request(stop=True))
    watching.send_request(Request(0.3))
    loop.end.receive(0.0)
    stop, slower = loop.end.requests()
    assert loop.end.requests() == []
    assert slower == Request(0.3)
    loop.drive.handle_request(stop)
    loop.run(5.0)
    assert loop.fault == "stop requested"
    assert loop.speed() < 0.01


@pytest.mark.slow
def test_a_stop_that_makes_a_robot_faster_is_left_to_its_driver():
    """So bad a link, 14 of 15 statuses lost, that no torque in time comes of it."""
    loop = Loop(panda(), options=DriverOptions()).begin().run(0.9)
    before, fastest = loop.speed(), 0.0
    while not loop.drive.has_ended:
        for _ in range(14):
            loop.robot.advance()
            fastest = max(fastest, loop.speed())
        loop.run(loop.drive.time + 1e-9)
    for _ in range(600):
        loop.robot.advance()
        fastest = max(fastest, loop.speed())
    assert "no status of the robot for 14 ms" in loop.fault
    assert loop.speed() < 0.05
    assert fastest < 3.0 * before + 0.5


@pytest.mark.parametrize(
    ("values", "request_"),
    [
        ({"override": 0.4}, Request(0.4)),
        ({"override": 7.0}, Request(LARGEST_OVERRIDE)),
        ({"override": -1.0}, Request(0.0)),
        ({"override": np.nan}, Request(0.0)),
        ({"stop": 1.0}, Request(stop=True)),
        ({"stop": np.nan}, Request(stop=True)),
        ({"other": 1.0}, Request()),
    ],
)
def test_requests_are_bounded(values, request_):
    assert Request.of(decode_values(encode_values(3, values))) == request_
    assert Request.of(request_.values()) == request_


@pytest.mark.parametrize("data", [b"", b"12345678", encode_values(1, {"a": 1.0})[:-2], bytes(40)])
def test_what_is_no_request_is_not_heard(data):
    loop = Loop(panda())
    loop.end.lcm.Publish("PFSC_REQUEST", data)
    loop.end.receive(0.0)
    assert loop.end.requests() == []


def test_keys():
    keys = DriveKeys()
    assert keys.requests("-", 1.0) == [Request(0.9)]
    assert keys.requests("+++", 1.4) == [Request(1.5)] * 3
    assert keys.requests("--", 0.2) == [Request(0.1)] * 2
    assert keys.requests(" ", 0.7) == [Request(0.0)]
    assert keys.requests(" ", 0.0) == [Request(0.7)]
    assert keys.requests("xq\n", 1.0) == [Request(stop=True)]


def test_keys_of_a_terminal(monkeypatch):
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "r") as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        with pressed_keys() as pressed:
            assert pressed() == ""
            os.write(ours, b" q")
            assert pressed() == " q"
    os.close(ours)


def test_keys_of_what_is_no_terminal():
    with Path(os.devnull).open() as nothing, pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdin", nothing)
        with pressed_keys() as pressed:
            assert pressed() == ""
