"""Figures of guidance within regions, drawn from a made-up log."""

import numpy as np
import pytest

from experiments.figures.all import draw_figures
from experiments.figures.guidance import (
    draw_contact,
    draw_energy,
    draw_guidance,
    draw_limits,
    gives_energy,
    has_contact,
    held_by_robot,
)
from experiments.results.run_log import RunLog
from pfsc_drake.control.fixtures.program import SLOTS
from pfsc_drake.control.fixtures.record import SLOT

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
    assert has_contact(log)
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
    assert not has_contact(log)


def test_limits_of_the_robot_that_held_are_drawn(log):
    forces = np.zeros((len(TIME), 3))
    log.add("limit_force", forces, "N", ["speed_3", "end_5", "singular"])
    assert not held_by_robot(log)
    forces[100:, 1], forces[200:, 2] = 4.0, 9.0
    log.add("limit_force", forces, "N", ["speed_3", "end_5", "singular"])
    assert held_by_robot(log)
    panel = draw_limits(log).canvas.axes[0]
    shown = {line.get_label(): line.get_ydata() for line in panel.lines}
    assert list(shown) == ["axis 5, end", "singular posture"]
    np.testing.assert_array_equal(shown["axis 5, end"], forces[:, 1])
