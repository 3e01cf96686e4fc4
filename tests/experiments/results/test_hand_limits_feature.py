"""Limits of the robot that hold a hand."""

import numpy as np
import pytest

from experiments.results.hand_limits_feature import draw_limits, limit_forces
from experiments.results.run_log import RunLog
from pfsc_drake.control.fixtures.contact_program import SLOTS
from pfsc_drake.control.fixtures.record import SLOT


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


def test_limits_of_the_robot_that_held_are_drawn(log):
    forces = np.zeros((len(TIME), 3))
    log.add("limit_force", forces, "N", ["speed_3", "end_5", "singular"])
    assert draw_limits(log) is None
    forces[100:, 1], forces[200:, 2] = 4.0, 9.0
    log.add("limit_force", forces, "N", ["speed_3", "end_5", "singular"])
    assert draw_limits(log)
    panel = draw_limits(log).canvas.axes[0]
    shown = {line.get_label(): line.get_ydata() for line in panel.lines}
    assert list(shown) == ["axis 5, end", "singular posture"]
    np.testing.assert_array_equal(shown["axis 5, end"], forces[:, 1])
