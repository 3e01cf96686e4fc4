"""Signals, metrics and audit of a tool that is led from afar, from a made-up log."""

import dataclasses as dc

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from diagrams.scenario.teleoperation import TeleoperationParameters
from experiments.results.features import draw_figures
from experiments.results.requirements import missed_targets, set_targets
from experiments.results.run_log import RunLog
from experiments.results.teleoperation_feature import (
    add_teleoperation,
    energy_above_bound,
    handle_warnings,
    stored_in_channel,
    tank_residual,
    teleoperation_metrics,
)
from pfsc_drake.control.teleoperation.port import RECORD
from tests.experiments.results.registry_names import names_about
from tests.scenarios import shipped_scenario

TIME = np.arange(2000) * 1e-3


LATE = 120  # ticks


FORCE, START = np.array([3.0, 0.0, 0.0]), np.array([0.5, 0.0, 1.0])


def records(position, force, tank, sent, received, owed):
    parts = {
        "force": force, "position": position, "tank": tank, "sent": sent,
        "received": received, "share": np.ones(len(TIME)),
        "owed": np.full(len(TIME), owed),
    }  # fmt: skip
    return np.column_stack([parts[name] for name in RECORD])


@pytest.fixture(name="log")
def fixture_log():
    """The leader moves along x; the tool does so later; the leader's work is all sent."""
    way = np.zeros((len(TIME), 3))
    way[:, 0] = 0.1 * np.sin(0.7 * TIME) ** 2
    late = np.vstack([np.zeros((LATE, 3)), way[:-LATE]])
    force = np.tile(FORCE, (len(TIME), 1))
    # against the hand: the tank gets it and sends it on
    taken = np.concatenate([[0.0], np.cumsum(3.0 * np.diff(way[:, 0]))])
    arrived = np.concatenate([np.zeros(LATE), taken[:-LATE]])
    tank = np.full(len(TIME), 0.5)
    raw = {
        "leader_record": records(way, -force, tank, taken, np.zeros(len(TIME)), 0.0),
        "follower_record": records(late, 0 * force, tank + arrived, 0 * taken, arrived, 4e-3),
        "leader_state": np.hstack([way, way]),
        "leader_hand": np.hstack([force, force]),
        "leader_motor": -force,
        "led_point": way + START,
    }
    log = RunLog(TIME)
    add_teleoperation(log, None, raw)
    log.add("y_t", late + START)
    return log


def test_a_handle_that_is_too_fast_is_reported(log, settings):
    """It moves at up to 0.07 m/s."""
    speed = teleoperation_metrics(log, settings)["largest_handle_speed"].value
    assert speed == pytest.approx(0.07, rel=1e-3)
    leader = settings.teleoperation.leader
    faster, slower = dc.replace(leader, largest_speed=0.06), dc.replace(leader, largest_speed=0.08)
    for device, said in ((slower, 0), (faster, 1)):
        way = dc.replace(settings.teleoperation, leader=device)
        found = handle_warnings(log, dc.replace(settings, teleoperation=way))
        assert len(found) == said
    assert "up to 0.07 m/s, faster than teleoperation.leader.largest_speed = 0.06 m/s" in found[0]


def test_what_a_side_owes_is_a_requirement(log, settings):
    metrics = teleoperation_metrics(log, settings)
    assert metrics["owed_distance_end"].value == 4e-3
    set_targets(metrics, settings)
    missed = missed_targets(metrics)
    assert any(phrase.startswith("owed_distance_end = 4\u202fmm") for phrase in missed)


@pytest.fixture(name="settings")
def fixture_settings():
    settings = shipped_scenario("teleop_region")
    settings.teleoperation = TeleoperationParameters()
    return settings


def test_the_delay_is_found(log, settings):
    metrics = teleoperation_metrics(log, settings)
    assert metrics["following_delay"].value == pytest.approx(LATE * 1e-3)
    assert metrics["following_error"].value == pytest.approx(0.0, abs=1e-12)
    apart = abs(log["led_point"].values[-1, 0] - log["y_t"].values[-1, 0])
    assert metrics["led_distance_end"].value == pytest.approx(apart)
    assert metrics["largest_felt_force"].value == pytest.approx(3.0)


def test_an_honest_log_passes_the_audit(log, settings):
    metrics = teleoperation_metrics(log, settings)
    assert metrics["audit_ports"].value < 1e-12
    assert metrics["audit_channel"].value == 0.0
    assert metrics["least_port_tank"].value == 0.5
    assert metrics["energy_margin"].value == pytest.approx(1.0)


@pytest.fixture(name="turning")
def fixture_turning(log):
    """The same, and the leader turns about an axis that is not fixed; the tool does so later.

    The hand holds a moment m, the port -m, so that the tank gets its work over the turns.
    """
    angle = 0.3 * np.sin(0.7 * TIME) ** 2
    turn = np.stack([angle, 0.5 * angle**2, -0.4 * angle], axis=1)
    late = np.vstack([np.zeros((LATE, 3)), turn[:-LATE]])
    moment = np.tile([0.5, -0.2, 0.3], (len(TIME), 1))
    R = Rotation.from_rotvec(turn)
    steps = np.sum(moment[:-1] * (R[1:] * R[:-1].inv()).as_rotvec(), axis=1)
    taken = np.concatenate([[0.0], np.cumsum(steps)])
    arrived = np.concatenate([np.zeros(LATE), taken[:-LATE]])
    turning = RunLog(TIME)
    for name, signal in log.signals.items():
        turning.add(name, signal.values.copy(), signal.unit, signal.labels)
    turning["port_sent"].values[:, 0] += taken
    turning["port_received"].values[:, 1] += arrived
    turning["port_tank"].values[:, 1] += arrived
    turning.add("port_moment", np.hstack([-moment, 0.0 * moment]))
    turning.add("port_turn", np.hstack([turn, late]))
    turning.add("leader_orientation", R.as_matrix().reshape(-1, 9))
    turning.add("leader_hand_moment", moment)
    turning.add("leader_moment", -moment)
    R_0 = Rotation.from_rotvec([1.0, 2.0, 0.0])
    turning.add("led_orientation", (R * R_0).as_matrix().reshape(-1, 9))
    turning.add("R_e", (Rotation.from_rotvec(late) * R_0).as_matrix().reshape(-1, 9))
    return turning


def test_moments_do_work_too(turning, settings):
    metrics = teleoperation_metrics(turning, settings)
    assert metrics["audit_ports"].value < 1e-12
    ends = [Rotation.from_rotvec(turning["port_turn"].values[-1, k : k + 3]) for k in (0, 3)]
    apart = (ends[0] * ends[1].inv()).magnitude()
    assert metrics["led_turn_end"].value == pytest.approx(apart)
    assert metrics["largest_felt_moment"].value == pytest.approx(np.sqrt(0.38))
    turning["port_moment"].values[1000] *= 1.1
    assert teleoperation_metrics(turning, settings)["audit_ports"].value > 1e-6


def test_the_bound_counts_what_a_hand_turns(turning):
    """Done by a hand that pushes with 3 N and holds a moment, both as the port takes them."""
    taken = turning["port_sent"].values[:, 0]
    np.testing.assert_allclose(energy_above_bound(turning, 1.0), 1.0 + taken, atol=1e-12)


@pytest.mark.slow
def test_how_it_is_turned_is_drawn(turning):
    turning.add("eta", turning["y_t"].values, "m")
    assert "led_turns" in [drawing.name for drawing in draw_figures(turning, [])]


def test_metrics_of_six_axes_are_those_of_the_registry(turning, settings):
    found = set(teleoperation_metrics(turning, settings))
    assert found == set(names_about(turning, "port_force", "led_point", "led_orientation"))


def test_energy_from_nowhere_is_found(log, settings):
    log["port_received"].values[1999:, 1] += 0.3
    metrics = teleoperation_metrics(log, settings)
    assert metrics["audit_ports"].value == pytest.approx(0.3)
    assert metrics["audit_channel"].value > 0.2


def test_a_full_tank_loses_what_does_not_fit(log):
    capacity = 0.55
    tank = log["port_tank"].values
    tank[:, 1] = np.minimum(tank[:, 1], capacity)
    assert tank_residual(log, capacity) < 1e-12
    assert tank_residual(log, 1.0) > 1e-6


def test_the_bound_counts_the_true_work_on_both_ends(log):
    """A hand that is pushed back: 3 N over the way, twice where the scale says so."""
    back = RunLog(TIME)
    for name, signal in log.signals.items():
        back.add(name, signal.values.copy(), signal.unit, signal.labels)
    back["leader_hand"].values[:] *= -1.0
    way = 0.1 * np.sin(0.7 * TIME) ** 2
    np.testing.assert_allclose(energy_above_bound(back, 1.0), 1.0 - 3.0 * way, atol=1e-12)
    np.testing.assert_allclose(energy_above_bound(back, 2.0), 1.0 - 6.0 * way, atol=1e-12)
    back.add("wrench_ext", np.tile([0.0, 0.0, 2.0, 0.0, 0.0, 0.0], (len(TIME), 1)))
    back.add("R_e", np.tile(np.eye(3).ravel(), (len(TIME), 1)))
    back["y_t"].values[:, 2] = 1.0 + 0.05 * TIME
    expected = 1.0 - 3.0 * way + 2.0 * 0.05 * TIME
    np.testing.assert_allclose(energy_above_bound(back, 1.0), expected, atol=1e-12)


def test_energy_is_counted_at_the_follower(log, settings):
    """A hand that is pushed back with 3 N at half the motion and a quarter of the force."""
    log["leader_hand"].values[:] *= -1.0
    settings.teleoperation.motion_scale, settings.teleoperation.force_scale = 2.0, 0.25
    farthest = log["leader_position"].values[:, 0].max()
    expected = 1.0 - 2.0 / 0.25 * 3.0 * farthest
    found = teleoperation_metrics(log, settings)["energy_margin"].value
    assert found == pytest.approx(expected, rel=1e-6)


def test_the_channel_stores_what_is_under_way(log):
    stored = stored_in_channel(log)
    way = 0.1 * np.sin(0.7 * TIME) ** 2
    expected = 3.0 * (way[LATE:] - way[:-LATE])
    np.testing.assert_allclose(stored[LATE:, 0], expected, atol=1e-12)
    np.testing.assert_array_equal(stored[:, 1], 0.0)


def test_metrics_are_those_of_the_registry(log, settings):
    found = set(teleoperation_metrics(log, settings))
    assert found == set(names_about(log, "port_force", "led_point"))


def test_its_figures_are_drawn(log):
    log.add("eta", log["y_t"].values, "m")
    names = [drawing.name for drawing in draw_figures(log, [])]
    assert {"teleoperation", "port_energy"} <= set(names)
