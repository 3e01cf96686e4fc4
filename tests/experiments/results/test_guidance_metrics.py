"""Metrics of a tool led within regions, from what a log says of a motion made up here."""

import numpy as np
import pytest

from experiments.results.guidance_metrics import deepest_violation, guidance_metrics
from experiments.results.guidance_signals import limit_forces
from experiments.results.run_log import RunLog
from pfsc_drake.control.fixtures.program import SLOTS
from pfsc_drake.control.fixtures.record import SLOT

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
