"""Metrics of a tool led within regions, from what a log says of a motion made up here."""

import math

import numpy as np
import pytest

from diagrams.scenario import Scenario
from diagrams.scenario.fixtures import FixtureParameters
from diagrams.scenario.robot import ServoParameters
from experiments.results.guidance import (
    deepest_violation,
    guidance_metrics,
    guidance_warnings,
    limit_forces,
    observed_lag,
    region_times,
)
from experiments.results.run_log import RunLog
from pfsc_drake.control.fixtures.guidance import ProgramGuidance
from pfsc_drake.control.fixtures.parameters import GuidanceParameters
from pfsc_drake.control.fixtures.program import MOST_NEAR, SLOTS
from pfsc_drake.control.fixtures.record import SLOT
from pfsc_drake.following.options.controller import ControllerParameters
from tests.control.fixtures.point_robot import (
    DELAY,
    LAG,
    PERIOD,
    half_space,
    lead,
    point,
    random_hand,
)

NAN = np.nan


@pytest.mark.parametrize(
    ("distances", "deepest"),
    [
        ([3, 1, 2], 0),
        ([3, -1, 2, -2, 1], 2),
        # it begins in the region and is moved out
        ([-5, -3, -3, 1], 0),
        # and comes in again, or goes deeper
        ([-5, -3, -4, 1, -2], 2),
        ([-5, -7, -3], 2),
        # switched on over the tool, off, and on again
        ([NAN, -4, -3, NAN, -6, -5], 0),
        ([1, NAN, NAN, -6, -6.5, NAN], 0.5),
        ([NAN, NAN], 0),
    ],
)
def test_what_a_tool_was_in_before_is_no_violation_as_long_as_it_leaves(distances, deepest):
    clear = np.full(len(distances), 9.0)
    both = np.stack([clear, np.array(distances, dtype=float)], axis=1)
    assert deepest_violation(both) == pytest.approx(deepest)


def make_log(ticks, regions=2):
    """A log of a tool that rests, and is asked nothing."""
    log = RunLog(1e-3 * np.arange(ticks))
    log.add("region_distance", np.ones((ticks, regions)), "m")
    slots = np.zeros((ticks, SLOTS, len(SLOT)))
    slots[..., SLOT.index("index")] = -1.0
    log.add("near_regions", slots.reshape(ticks, -1), "")
    for name, width in (("velocity_command", 3), ("guiding_force", 3), ("tank", 1)):
        log.add(name, np.zeros((ticks, width)), "")
    log.add("mode", np.zeros((ticks, 1), dtype=int), "1", ["free"])
    log.add("region_evaluated", np.ones((ticks, regions), dtype=int), "1")
    return log


def test_what_was_asked_and_what_the_hand_got_out_of_it():
    """A hand gives 3 J, gets 5 J back and gives 4 J: the most that it ever had is 2 J."""
    log = make_log(10)
    v, f = log["velocity_command"].values, log["guiding_force"].values
    v[:, 0], v[:, 1] = 0.3, 0.4
    v[7:] = -v[7:]
    f[1:4, 0], f[4:6, 0], f[8, 0] = 1e3 / 0.3, -2.5e3 / 0.3, -4e3 / 0.3
    metrics = guidance_metrics(log)
    assert metrics["energy_from_fixtures"].value == pytest.approx(2.0)
    assert metrics["largest_command"].value == pytest.approx(0.5)
    assert metrics["largest_command_step"].value == pytest.approx(1.0)


def test_a_soft_region_that_yields_is_not_violated():
    """The first region is soft, the second its hard core."""
    log = make_log(4)
    soft, core = [2e-3, -3e-3, -8e-3, -8.5e-3], [12e-3, 7e-3, 2e-3, -0.3e-3]
    log["region_distance"].values[:] = np.array([soft, core]).T
    slots = log["near_regions"].values.reshape(4, SLOTS, len(SLOT))
    slots[1:, 0, SLOT.index("index")] = 0.0
    slots[1:, 0, SLOT.index("stiffness")] = 3e3
    slots[2:, 1, SLOT.index("index")] = 1.0
    metrics = guidance_metrics(log)
    assert metrics["deepest_violation"].value == pytest.approx(0.3e-3)
    assert metrics["deepest_in_soft"].value == pytest.approx(8.5e-3)


def test_forces_of_the_robots_own_limits_stand_behind_the_regions():
    """Of two regions and three joints: joint 2 at its speed, its lower end, a singular posture."""
    slots = np.zeros((2, SLOTS, len(SLOT)))
    index, phi = SLOT.index("index"), SLOT.index("phi")
    slots[..., index] = -1.0
    held = [(1, 50.0), (2 + 4, 1.0), (2 + 5, 2.0), (2 + 7, 4.0), (2 + 12, 8.0), (2 + 13, 16.0)]
    for slot, (number, force) in enumerate(held):
        slots[1, slot, index], slots[1, slot, phi] = number, force
    kinds, forces = limit_forces(slots.reshape(2, -1), 2, 3)
    assert kinds == ["speed_1", "end_1", "speed_2", "end_2", "speed_3", "end_3", "singular"]
    assert not forces[0].any()
    np.testing.assert_array_equal(forces[1], [0, 0, 3.0, 4.0, 0, 0, 24.0])


def test_the_tool_meets_regions_as_they_were_a_lag_ago():
    """Of a clock that runs, waits and runs on; before the start it had not begun."""
    lag, time = 7e-3, 1e-3 * np.arange(200)
    clock = lag + np.clip(time, 0.0, 0.05) + np.clip(time - 0.1, 0.0, None)
    log = RunLog(time)
    log.add("region_clock", clock, "s")
    met = region_times(log, lag)
    np.testing.assert_allclose(met[:7], 0.0, atol=1e-12)
    np.testing.assert_allclose(met[7:], clock[:-7], atol=1e-12)


def run(walls, believed, hand, start, noise=0.0):
    """Log of a point behind servos of 5 ms and a bus of 2 ms."""
    guidance = ProgramGuidance(
        point(walls, believed), GuidanceParameters(), [math.inf] * len(walls)
    )
    record = lead(guidance, start, hand, 1.5)
    rows, layout = np.array([step.record for step in record.steps]), guidance.layout
    part = {name: rows[:, place] for name, place in layout.fields.items()}
    log = RunLog(PERIOD * np.arange(len(rows)))
    y = np.array(record.y)
    log.add("y_t", y, "m")
    log.add("y_t_measured", y + noise * np.random.default_rng(1).normal(size=y.shape), "m")
    log.add("velocity_command", part["velocity"], "m/s")
    log.add("rest_point", part["point"], "m")
    log.add("squeezed", part["squeezed"], "1")
    log.add("near_regions", part["near"], "", [f"{k}_{s}" for s in range(MOST_NEAR) for k in SLOT])
    names = [f"plane_{i + 1}" for i in range(len(walls))]
    log.add("region_distance", np.array([[w(p, 0.0)[0] for w in walls] for p in y]), "m", names)
    return log


def scenario(believed):
    return Scenario(
        controller=ControllerParameters(law="velocity_servo", manifold="space"),
        fixtures=FixtureParameters(servo_lag=believed),
        servo=ServoParameters(bandwidth=300.0, bus_delay=DELAY),
    )


FLOOR = half_space((0, 0, -0.03), (0, 0, 1))


@pytest.mark.slow(but="0.005")
@pytest.mark.parametrize("believed", [2e-3, 5e-3, 12e-3])
def test_the_lag_is_seen_whatever_was_believed(believed):
    """Also with 1 um of noise on the measured place, and where the floor holds the tool."""
    log = run([FLOOR], believed, random_hand(2), (0, 0, 0), noise=1e-6)
    assert observed_lag(log, believed) == pytest.approx(LAG, rel=0.1)
    said = guidance_warnings(log, scenario(believed))
    assert bool(said) == (believed != LAG)
    if said:
        assert f"not by {1e3 * believed:g} ms" in said[0]
        least = float(said[0].split("approach_time to ")[1].split(" s")[0])
        assert least == pytest.approx(2.0 * (LAG + DELAY), rel=0.1)


def test_a_tool_that_rests_tells_no_lag():
    log = run([FLOOR], 2e-3, lambda t, y: np.zeros(3), (0, 0, 0))
    assert observed_lag(log, 2e-3) is None
    assert guidance_warnings(log, scenario(2e-3)) == []


def test_walls_that_squeeze_are_named_with_how_deep_it_was():
    walls = [half_space((0.5, 0, 0), (1, 0, 0)), FLOOR, half_space((0, 0, -0.034), (0, 0, -1))]
    log = run(walls, LAG, lambda t, y: np.zeros(3), (1.0, 0, -0.032))
    (said,) = guidance_warnings(log, scenario(LAG))
    assert said.startswith("plane_2 and plane_3 squeezed the tool for 1.5 s from t = 0.000 s on")
    assert "up to 2 mm in one" in said
