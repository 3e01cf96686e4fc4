"""Guidance within virtual fixtures: metrics and figures, from made-up logs."""

import numpy as np
import pytest

from experiments.results.features import draw_figures
from experiments.results.guidance_feature import (
    deepest_violation,
    draw_contact,
    draw_energy,
    draw_guidance,
    gives_energy,
    guidance_metrics,
    region_times,
)
from experiments.results.run_log import RunLog
from pfsc_drake.control.fixtures.contact_program import SLOTS
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


def test_the_tool_meets_regions_as_they_were_a_lag_ago():
    """Of a clock that runs, waits and runs on; before the start it had not begun."""
    lag, time = 7e-3, 1e-3 * np.arange(200)
    clock = lag + np.clip(time, 0.0, 0.05) + np.clip(time - 0.1, 0.0, None)
    log = RunLog(time)
    log.add("region_clock", clock, "s")
    met = region_times(log, lag)
    np.testing.assert_allclose(met[:7], 0.0, atol=1e-12)
    np.testing.assert_allclose(met[7:], clock[:-7], atol=1e-12)


TIME = np.linspace(0.0, 2.0, 2001)


ON = (TIME > 0.5) & (TIME < 1.5)  # on the cylinder r = 0.2 m about z, turning and rising


@pytest.fixture(name="log")
def fixture_log():
    log, count = RunLog(TIME), len(TIME)
    angle, height = 0.5 * TIME, 0.1 * TIME
    y_t = np.column_stack([0.2 * np.cos(angle), 0.2 * np.sin(angle), height])
    log.add("y_t", y_t, "m", ["x", "y", "z"])
    log.add("eta", y_t, "m")
    log.add("eta_p", y_t, "m")
    log.add("mode", ON.astype(int), "1", ["free", "surface", "edge", "corner"])
    near = np.where(ON, 1e-5, 0.01)
    log.add("region_distance", np.column_stack([near, np.full(count, 0.5)]), "m", ["well", "far"])
    log.add("region_labels", np.column_stack([ON, 0 * ON]).astype(int), "1", ["well", "far"])
    slots = np.zeros((count, SLOTS, len(SLOT)))
    slots[..., 0] = -1.0
    slots[:, 2, 0] = 0.0  # the well stands in any slot
    slots[:, 2, 2:5] = -np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    slots[:, 2, SLOT.index("phi")] = np.where(ON, 7.0, 0.0)
    log.add("near_regions", slots.reshape(count, -1), "")
    log.add("velocity_command", np.full((count, 3), 0.1), "m/s")
    log.add("guiding_force", np.full((count, 3), -2.0), "N")
    log.add("tank", np.full((count, 1), 0.5), "J")
    log.add("spring_energy", np.zeros((count, 1)), "J")
    log.add("region_rate", np.ones((count, 1)), "1")
    return log


def test_mode_has_its_names(log):
    mode = draw_guidance(log).canvas.axes[0]
    assert [label.get_text() for label in mode.get_yticklabels()] == log["mode"].labels
    np.testing.assert_array_equal(mode.lines[0].get_ydata(), ON)


def test_only_regions_that_were_near_are_drawn(log):
    _, distance, *_ = draw_guidance(log).canvas.axes
    names = [line.get_label() for line in distance.lines]
    assert "well" in names
    assert "far" not in names


def test_coordinates_along_a_cylinder_are_arc_and_height(log):
    """As in Fig. 5.10: the first is the arc in the plane, the second the height."""
    assert draw_contact(log)
    level, rising = draw_contact(log).canvas.axes[0].lines
    t = TIME[ON] - TIME[ON][0]
    np.testing.assert_allclose(rising.get_ydata(), 0.1 * t, atol=1e-9)
    np.testing.assert_allclose(np.abs(level.get_ydata()), 0.2 * 0.5 * t, atol=1e-6)


def test_forces_of_the_contact(log):
    force = draw_contact(log).canvas.axes[2].lines
    np.testing.assert_allclose(force[0].get_ydata(), 7.0)
    angle = 0.5 * TIME[ON]
    into = -2.0 * (np.cos(angle) + np.sin(angle))
    np.testing.assert_allclose(force[1].get_ydata(), into, atol=1e-12)


def test_energy_is_drawn_where_some_went_back_and_forth(log):
    assert not gives_energy(log)
    log["spring_energy"].values[100] = 1e-3
    assert gives_energy(log)
    work = draw_energy(log).canvas.axes[1].lines[0].get_ydata()
    assert work[-1] == pytest.approx(-0.6 * 2.001, rel=1e-6)


def test_a_tool_in_space_has_no_progress_along_anything(log):
    names = [drawing.name for drawing in draw_figures(log, [np.zeros((2, 3))] * 2)]
    assert "progress" not in names
    assert {"guidance", "contact"} <= set(names)
    log["region_labels"].values[:] = 0
    assert draw_contact(log) is None
