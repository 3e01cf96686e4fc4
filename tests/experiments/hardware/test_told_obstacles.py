"""A robot that is driven waits for obstacles of which messages tell, and for messages."""

import math

import numpy as np
import pytest

from diagrams.scenario.obstacles import CrossingParameters
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters
from pfsc_drake.drivers.remote_values import Request, decode_values, encode_values
from tests.experiments.hardware.test_drive import Loop, panda

LATENCY = 0.1
FAR = (5.0, 5.0, 0.0, 0.0, 0.0, 0.0)


@pytest.fixture(name="log", scope="module")
def fixture_log():
    settings = panda()
    watch = WatchParameters(largest_acceleration=5.0, latency=LATENCY)
    settings.obstacles = CrossingParameters(watch=watch)
    loop = Loop(settings).begin().run(0.3)

    def told(request, until):
        while loop.drive.time < until - 1e-9:
            loop.drive.handle_request(request)
            loop.run(loop.drive.time + 0.05)

    told(Request(obstacles=FAR), 1.0)
    loop.run(1.6)  # silence
    told(Request(obstacles=FAR, age=2.0 * LATENCY), 1.8)
    told(Request(obstacles=FAR[:5]), 2.0)
    told(Request(obstacles=FAR), 2.4)
    assert loop.fault is None
    return loop.log()


@pytest.mark.slow
def test_nothing_moves_before_something_is_told(log):
    assert np.abs(log["waiting_pace"].values[log.time < 0.3]).max() == 0.0


@pytest.mark.slow
def test_it_moves_while_it_is_told_and_waits_in_silence(log):
    pace, t = log["waiting_pace"].values[:, 0], log.time
    assert pace[(t > 0.9) & (t < 1.0)].min() > 0.95
    # the last message was at 0.95 s
    assert pace[(t > 0.96) & (t < 0.95 + LATENCY)].min() > 0.95
    assert pace[(t > 1.45) & (t < 1.6)].max() < 1e-3
    assert np.isnan(log["obstacle_position"].values[(t > 1.1) & (t < 1.6)]).all()


@pytest.mark.slow
def test_what_is_old_or_told_in_part_counts_for_nothing(log):
    pace, t = log["waiting_pace"].values[:, 0], log.time
    assert pace[(t > 1.6) & (t < 2.0)].max() < 1e-3
    assert pace[-1] > 0.9


def test_messages_tell_of_obstacles_and_of_their_age():
    request = Request(obstacles=(*FAR, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0), age=0.02)
    values = decode_values(encode_values(0, request.values()))
    assert values["obstacle_2_v_x"] == 4.0
    assert Request.of(values) == request
    assert Request.of({"override": 0.5}).obstacles == ()
    part = Request.of({"obstacle_1_x": 1.0, "obstacles_age": -1.0})
    assert part.obstacles[0] == 1.0
    assert all(math.isnan(value) for value in part.obstacles[1:])
    assert part.age == math.inf
