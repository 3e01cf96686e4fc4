"""Motions of users' diagrams that keep the limits of the drives."""

import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder

from pfsc_drake import (
    FollowerOptions,
    InputError,
    MotionLimits,
    WaypointTable,
    add_path_following,
    path_from_waypoints,
    rest_to_rest,
)
from tests.controller.test_path_following import load

POINTS = np.array([[0.9, y, 0.8] for y in np.linspace(-0.4, 0.4, 9)])


@pytest.fixture(name="path", scope="module")
def fixture_path():
    return path_from_waypoints(WaypointTable(POINTS), smoothness=6)


def follower(path, limits, velocity=0.5, acceleration=4.0, **changes):
    builder = DiagramBuilder()
    plant = load(builder, "comau_racer_1_4_3r")
    motion = rest_to_rest([0.0, 0.7], velocity=velocity, acceleration=acceleration)
    options = FollowerOptions(reference=limits, **changes)
    return add_path_following(
        builder, plant, "tool_point", path, "rigid", motion=motion, options=options
    )


def demand(made):
    """Return torques and speeds along a motion as shares of the drives' limits, (samples, N)."""
    plan, robot = made.followed.drive_plan, made.robot
    return np.abs(plan.demand[:, :3]) / robot.gather("effort_limit")


def test_a_motion_that_takes_too_much_is_slowed_and_one_that_fits_is_not(path):
    slow = follower(path, MotionLimits(), velocity=0.3, acceleration=1.0)
    assert not slow.warnings
    asked = rest_to_rest([0.0, 0.7], velocity=0.3, acceleration=1.0).domain[1]
    assert slow.followed.motion.domain[1] == asked
    fast = follower(path, MotionLimits(reserve=0.2), velocity=4.0, acceleration=60.0)
    (said,) = [line for line in fast.warnings if "slowed" in line]
    assert "reference is slowed" in said and "axis" in said
    asked = rest_to_rest([0.0, 0.7], velocity=4.0, acceleration=60.0).domain[1]
    assert fast.followed.motion.domain[1] > 1.1 * asked
    assert 0.6 < demand(fast).max() < 0.81
    warned = follower(path, MotionLimits(limits="warn", reserve=0.2), 4.0, 60.0)
    assert warned.followed.motion.domain[1] == pytest.approx(asked)
    assert any("the requested motion needs" in line for line in warned.warnings)


@pytest.mark.slow
def test_the_fastest_motion_uses_what_the_reserve_leaves(path):
    made = follower(
        path, MotionLimits(speed="fastest", torque_rate=np.inf, reserve=0.4, dwell=0.05)
    )
    assert 0.59 < demand(made).max() < 0.61
    end = made.followed.motion.derivatives(np.array(made.followed.motion.domain[1:]), 0)
    assert end[0, 0, 0] == pytest.approx(0.7, abs=1e-6)


@pytest.mark.parametrize(
    ("limits", "changes", "said"),
    [
        (MotionLimits(acceleration=2.0), {}, "reference.acceleration = 2: has no effect"),
        (MotionLimits(velocity=2.0), {}, "reference.velocity = 2: .* needs speed fastest"),
        (MotionLimits(), {"frame": np.array([0.0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1])}, "reference"),
    ],
)
def test_limits_without_effect_are_refused(path, limits, changes, said):
    with pytest.raises(InputError, match=said):
        follower(path, limits, **changes)
