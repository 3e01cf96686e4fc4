"""What a motion is judged by, from motions that are known."""

import numpy as np
import pytest

from experiments.studies.peers.lap import Lap
from experiments.studies.peers.score import score
from experiments.studies.peers.world import RobotMotion


@pytest.fixture(scope="module")
def lap():
    return Lap(duration=2.5)


@pytest.fixture(scope="module")
def station(lap):
    return lap.station


@pytest.fixture(scope="module")
def motion(lap):
    """The plan itself, every 10 ms."""
    time = np.arange(0.0, lap.duration, 0.01)
    q = lap.fastest.sampled(len(time), 0.01)[:, 0]
    return RobotMotion(time, q, np.full((len(time), 7), -0.5), np.zeros((len(time), 3)))


def test_a_motion_on_the_path(lap, station, motion):
    plan = lap.fastest
    found = score(lap, station.part.robot, motion)
    assert found.largest < 2e-6
    assert found.turned < 1e-5
    assert found.effort == 0.5
    assert np.isnan(found.hand)
    # the last 5 mm, at the acceleration of the end, take less than 100 ms
    assert plan.duration - 0.1 < found.time <= plan.duration + 0.01


def test_what_a_hand_does_is_not_judged(lap, station, motion):
    q, force = motion.q.copy(), np.zeros((len(motion.time), 3))
    q[motion.time > 2.2, 1] += 0.05
    force[-1] = [3.0, 0.0, 4.0]
    pushed = RobotMotion(motion.time, q, motion.effort, force)
    found = score(lap, station.part.robot, pushed, held_from=2.2)
    assert found.largest < 2e-6
    assert found.hand == 5.0
    assert score(lap, station.part.robot, pushed).largest > 1e-2


def test_who_never_arrives_has_no_time(lap, station, motion):
    short = RobotMotion(*(x[motion.time < 1.0] for x in list(vars(motion).values())[:4]))
    assert np.isnan(score(lap, station.part.robot, short).time)


def test_a_fault_leaves_no_numbers(lap, station, motion):
    stopped = RobotMotion(motion.time, motion.q, motion.effort, motion.hand, "it fell")
    found = score(lap, station.part.robot, stopped)
    assert np.isnan(found.largest)
    assert str(found) == "it fell"
