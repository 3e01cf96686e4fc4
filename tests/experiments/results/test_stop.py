"""Motion after a fault, from made-up motions of a joint that turns and one that slides."""

import numpy as np
import pytest

from experiments.results.drives import DriveLimitsOfRun
from experiments.results.run_log import RunLog
from experiments.results.stop import MotionAfterFault
from reporting.metrics import NARROW_SPACE

LIMITS = DriveLimitsOfRun(
    ["turn", "slide"], np.array([True, False]), np.full((2, 2), np.inf), np.full(2, np.inf)
)
TIME = np.linspace(0.0, 2.0, 2001)


def motion(turning, sliding):
    """Return what there is to say of speeds after a fault at 0.5 s; before it 0.4 rad/s, 0.2 m/s.

    The tool moves as the slide does.
    """
    after = TIME >= 0.5
    v = np.stack(
        [np.where(after, turning(TIME - 0.5), 0.4), np.where(after, sliding(TIME - 0.5), 0.2)],
        axis=1,
    )
    q = np.vstack([np.zeros(2), np.cumsum(v[:-1] * np.diff(TIME)[:, None], axis=0)])
    log = RunLog(TIME, turning=[True, False], attributes={"fault_time": "0.500000"})
    log.add("q_J", q)
    log.add("v_J", v)
    log.add("y_t", np.outer(q[:, 1], [0.0, 1.0, 0.0]))
    return MotionAfterFault(log, LIMITS)


def ramp(speed, duration):
    return lambda t: speed * np.maximum(1.0 - t / duration, 0.0)


def test_a_stop_is_within_its_bound():
    """Half of the speed times the duration."""
    found = motion(ramp(0.4, 0.3), ramp(0.2, 0.5))
    metrics = found.metrics()
    turned, slid = metrics["motion_after_fault"], metrics["slide_motion_after_fault"]
    assert turned.value == pytest.approx(0.06, rel=0.01) and turned.passed
    assert slid.value == pytest.approx(0.05, rel=0.01) and slid.passed
    assert turned.bound == ("<=", pytest.approx(0.3)) and slid.bound == ("<=", pytest.approx(0.12))
    assert found.rests
    words = found.sentence().replace(NARROW_SPACE, " ")
    assert words.startswith("stopped at t = 2.000 s; after the fault joint 1 moved 60")
    assert words.endswith(" mrad, the tool 50.1 mm")


def test_a_joint_that_runs_away_is_named_with_its_speed():
    found = motion(lambda t: 0.4 + 0.5 * t, ramp(0.2, 0.5))
    assert found.metrics()["motion_after_fault"].passed is False
    assert found.metrics()["slide_motion_after_fault"].passed
    assert not found.rests
    assert "still moving at t = 2.000 s, joint 1 at 1.15 rad/s" in found.sentence()
    assert "stopped" not in found.sentence()


def test_a_slide_that_creeps_is_no_stop():
    found = motion(ramp(0.4, 0.3), lambda t: np.full_like(t, 0.2))
    assert found.metrics()["slide_motion_after_fault"].passed is False
    assert "still moving at t = 2.000 s, joint 2 at 0.2 m/s" in found.sentence()
