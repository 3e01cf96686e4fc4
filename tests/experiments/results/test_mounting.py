"""Metrics of a made-up mounting."""

import math

import numpy as np
import pytest

from experiments.results.mounting import mounting_metrics
from experiments.results.run_log import RunLog
from tests.experiments.results.registry_names import names_about

TIME = np.linspace(0.0, 10.0, 1001)


@pytest.fixture(name="log")
def fixture_log():
    """At the frame at 4 s, touching at 5 s, seated at 6 s, let go at 7 s."""
    gap = np.interp(TIME, [0.0, 4.0, 5.0, 6.0], [0.5, 0.02, 0.012, 0.0])
    log = RunLog(TIME)
    log.add("seat_gap", np.column_stack([gap, 0.999 * gap]), "m")
    log.add("seat_offset", np.interp(TIME, [0.0, 3.0], [1.0, 1e-4]), "m")
    touching = np.where(TIME >= 5.0, 3.0, 0.0)
    log.add("frame_force", np.outer(touching, [0.0, 0.6, 0.8]), "N")
    log.add("magazine_force", np.outer(TIME < 1.0, [0.0, 0.0, 8.0]), "N")
    log.add("held", np.select([TIME < 1.0, TIME < 7.0], [0.0, 1.0], 0.0), "1")
    log.add("hand_wrench", np.outer(np.sin(TIME), [30.0, 0, 40.0, 0, 3.0, 4.0]), "N, Nm")
    log.add("xi", np.outer(np.where(TIME >= 5.0, 1e-3, 9.0), [0.6, 0.8]), "m")
    log.add("phi", np.outer(np.where(TIME <= 6.0, 1e-2, 9.0), [0.0, 0.6, 0.8]), "rad")
    return log


def test_a_mounted_plate(log):
    metrics = mounting_metrics(log)
    value = {name: metric.value for name, metric in metrics.items()}
    assert list(metrics) == names_about(log, "seat_gap")
    assert value["mounted"] == 1.0
    assert value["final_seat_gap"] == 0.0
    for name, expected in {
        "grip_time": 1.0,
        "time_to_frame": 4.0,
        "time_to_contact": 5.0,
        "time_to_seat": 6.0,
        "insertion_time": 2.0,
        "release_time": 7.0,
    }.items():
        assert value[name] == pytest.approx(expected, abs=0.03)
    assert value["peak_frame_force"] == pytest.approx(3.0)
    assert value["peak_magazine_force"] == pytest.approx(8.0)
    assert value["insertion_deviation"] == pytest.approx(1e-3)
    assert value["insertion_rotation"] == pytest.approx(1e-2)
    assert value["peak_operator_force"] == pytest.approx(50.0, rel=1e-4)
    assert value["peak_operator_torque"] == pytest.approx(5.0, rel=1e-4)


def test_a_plate_that_is_not_let_go_is_not_mounted(log):
    log.signals["held"].values[:] = 1.0
    metrics = mounting_metrics(log)
    assert metrics["mounted"].value == 0.0
    assert metrics["grip_time"].value == 0.0
    assert math.isnan(metrics["release_time"].value)


def test_a_plate_that_jams_is_not_seated(log):
    log.signals["seat_gap"].values[:, 1] += 3e-4
    metrics = mounting_metrics(log)
    assert metrics["mounted"].value == 0.0
    for name in ("time_to_seat", "insertion_time", "insertion_deviation", "insertion_rotation"):
        assert math.isnan(metrics[name].value)


def test_a_gap_beside_the_frame_is_none(log):
    log.signals["seat_offset"].values[:] = 0.01
    assert math.isnan(mounting_metrics(log)["time_to_seat"].value)


def test_without_operator_there_are_no_metrics_of_one(log):
    del log.signals["hand_wrench"]
    metrics = mounting_metrics(log)
    assert "peak_operator_force" not in metrics
    assert list(metrics) == names_about(log, "seat_gap")


def test_other_runs_have_none():
    assert not mounting_metrics(RunLog(TIME))
    assert names_about(RunLog(TIME), "seat_gap") == []


def test_of_a_plate_that_is_gripped_twice_the_last_time_counts(log):
    slipped = (log.time > 2.0) & (log.time < 3.0)
    log["held"].values[slipped] = 0.5
    assert mounting_metrics(log)["grip_time"].value == pytest.approx(3.0, abs=0.011)
