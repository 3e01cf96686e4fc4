"""Metrics of path following against logs whose answers are known in closed form."""

import math

import numpy as np
import pytest

from experiments.results.drives import peak_torque, saturation_count
from experiments.results.path import (
    max_distance_from_notch_axis,
    max_external_force,
    max_manifold_force,
    max_orientation_error_after,
    max_path_deviation_after,
    max_path_deviation_while_moving,
    max_tangential_force,
    max_unanswered_force,
    path_distance,
    path_following_metrics,
    peak_speed,
    rms_path_deviation,
    settling_time,
    shape_metrics,
    static_path_deviation,
    tangential_error,
)
from experiments.results.run_log import RunLog
from pfsc_drake.geometry import (
    FourierCurve,
    OrientationCurve,
    Path,
    PiecewisePolynomialCurve,
    WaypointTable,
    path_from_waypoints,
    shape_report,
)
from tests.experiments.results.registry_names import names_about

RATE = 8.0  # 1/s
START = 0.01  # m
STEP = 1e-3  # s


def decaying_log() -> RunLog:
    """Distance START exp(-RATE t), shared 3:4 by the two coordinates, over 2 s."""
    time = STEP * np.arange(2001)
    log = RunLog(time)
    log.add("xi", START * np.exp(-RATE * time)[:, None] * [0.6, -0.8], "m")
    return log


def test_distance_is_euclidean():
    log = decaying_log()
    np.testing.assert_allclose(path_distance(log), START * np.exp(-RATE * log.time), rtol=1e-14)


def test_settling_time_of_an_exponential():
    tolerance = 0.05e-3
    exact = math.log(START / tolerance) / RATE
    # The first sample at or after the exact instant.
    assert settling_time(decaying_log(), tolerance) == pytest.approx(
        math.ceil(exact / STEP) * STEP, abs=1e-12
    )


def test_settling_time_counts_the_last_exit():
    log = RunLog(np.arange(6.0))
    log.add("xi", np.array([[5, 0], [0, 0], [0, 3], [0, 0], [0, 0], [0, 0]]) * 1e-3, "m")
    assert settling_time(log, 1e-3) == 3.0
    assert settling_time(log, 4e-3) == 1.0
    assert settling_time(log, 5e-3) == 0.0


@pytest.mark.parametrize("last", [2e-3, math.nan])
def test_never_settled_is_nan(last):
    log = RunLog(np.arange(3.0))
    log.add("xi", [[0, 0], [0, 0], [last, 0]], "m")
    assert math.isnan(settling_time(log, 1e-3))


def test_deviation_after():
    log = decaying_log()
    assert max_path_deviation_after(log, 0.5) == pytest.approx(START * math.exp(-RATE * 0.5))
    assert math.isnan(max_path_deviation_after(log, 3.0))


def test_deviation_while_moving():
    log = RunLog(np.arange(5.0))
    log.add("xi", np.array([[9, 0], [1, 0], [0, 2], [0, 7], [8, 0]]) * 1e-3, "m")
    log.add("eta_dot", [0.0, 1.0, -1.0, 0.2, 0.0], "m/s")
    assert max_path_deviation_while_moving(log, 0.5) == pytest.approx(2e-3)
    assert max_path_deviation_while_moving(log, 0.1) == pytest.approx(7e-3)
    assert math.isnan(max_path_deviation_while_moving(log, 0.5, t=2.5))


def test_rms_of_an_exponential():
    log = decaying_log()
    # Mean of START^2 exp(-2 RATE t) over [0, 2]; the sum over samples differs by O(STEP).
    exact = START * math.sqrt((1 - math.exp(-4 * RATE)) / (4 * RATE))
    assert rms_path_deviation(log) == pytest.approx(exact, rel=5e-3)
    assert rms_path_deviation(log, 1.0) < 1e-3 * exact


def test_static_deviation_is_the_mean_of_the_end():
    time = 0.1 * np.arange(11)
    log = RunLog(time)
    log.add("xi", np.where(time[:, None] > 0.75, [3e-3, 4e-3], [1.0, 0.0]), "m")
    assert static_path_deviation(log, 0.2001) == pytest.approx(5e-3)
    assert static_path_deviation(log, 0.3001) == pytest.approx((1.0 + 3 * 5e-3) / 4)


def test_orientation_speed_and_tangential_error():
    log = RunLog(np.arange(4.0))
    log.add("phi", np.array([[9, 0, 0], [1, 2, 2], [0, 0, 1], [0, 0, 0]]) * 1e-3, "rad")
    log.add("eta_dot", [0.1, -1.5, 1.2, 0.0], "m/s")
    log.add("eta", [0.0, 1.0, 2.0, 3.0], "m")
    log.add("eta_p", [0.0, 1.3, 1.9, 3.0], "m")
    assert max_orientation_error_after(log, 1.0) == pytest.approx(3e-3)
    assert peak_speed(log) == 1.5
    assert tangential_error(log) == pytest.approx(0.3)
    assert tangential_error(log, 2.0) == pytest.approx(0.1)


def test_torques_and_saturation():
    torque = np.array([[1.0, -5.0], [-3.0, 2.0], [2.9, 5.0 * (1 - 1e-12)], [0.0, 4.9]])
    log = RunLog(np.arange(4.0))
    log.add("tau_d", torque, "Nm", limits=[3.0, 5.0])
    np.testing.assert_allclose(peak_torque(log), [3.0, 5.0])
    assert saturation_count(log) == 3
    log.add("tau_d", torque, "Nm")
    assert saturation_count(log) == 0


def test_what_a_law_asks_too_much_of_servos_counts():
    """Speeds that the law asks for, torques of the servos, and the safe state after a fault."""
    log = RunLog(np.arange(6.0))
    log.add("tau_d", np.array([1.0, 3.0, 1.0, 1.0, 1.0, -3.0]), "Nm", limits=3.0)
    log.add("saturated_drives", np.array([0, 2, 1, 0, 6, 0]), "1")
    log.add("fault", np.array([0, 0, 0, 0, 4, 4]), "1", ["none"])
    # sample 4: the law asks in vain, for there is a fault; sample 5: the drives brake
    assert saturation_count(log) == 3
    del log.signals["tau_d"]
    assert saturation_count(log) == 2


def test_forces_count_once_the_sensor_is_tared():
    log = RunLog(np.arange(4.0))
    forces = [[90, 0, 0], [2, 3, 6], [-5, 0, 0], [0, 4, 0]]
    log.add("manifold_force", np.hstack([forces, np.full((4, 3), 50.0)]), "N, Nm")
    assert max_manifold_force(log) == 90.0
    log.add("tared", [0, 1, 1, 1], "1")
    assert max_manifold_force(log) == pytest.approx(7.0)  # sqrt(4 + 9 + 36)
    assert max_tangential_force(log) == 5.0
    log.add("tared", np.zeros(4), "1")
    assert math.isnan(max_manifold_force(log))
    assert math.isnan(max_tangential_force(log))


def test_forces_before_the_sensor_is_tared_are_answered_by_nobody():
    log = RunLog(np.arange(3.0))
    log.add("wrench_ext", [[3, 4, 0, 9, 9, 9], [0, 2, 0, 0, 0, 0], [90, 0, 0, 0, 0, 0]], "N, Nm")
    log.add("tared", [0, 0, 1], "1")
    assert max_unanswered_force(log) == 5.0
    log.add("tared", np.ones(3), "1")
    assert max_unanswered_force(log) == 0.0


def test_external_force():
    log = RunLog(np.arange(3.0))
    forces = [[0, 0, 0], [3, -4, 12], [5, 0, 0]]
    log.add("wrench_ext", np.hstack([forces, np.full((3, 3), 50.0)]), "N, Nm")
    assert max_external_force(log) == pytest.approx(13.0)


def test_distance_from_the_notch_axis():
    log = RunLog(np.arange(3.0))
    log.add("notch_position", [[0, 0], [-3e-3, -4e-3], [4e-3, 0]], "m")
    assert max_distance_from_notch_axis(log) == pytest.approx(5e-3)


def test_names_are_those_of_the_collection():
    log = decaying_log()
    samples = len(log.time)
    log.add("xi_p", np.zeros((samples, 2)), "m")
    for name in ("eta", "eta_p", "eta_dot"):
        log.add(name, np.zeros(samples), "m")
    log.add("tau_d", np.ones((samples, 3)), "N")
    about = ("xi", "xi_d", "xi_M", "phi", "eta", "eta_dot", "tau_d")
    about += ("manifold_force", "wrench_ext", "notch_position")
    metrics = path_following_metrics(log, 5e-5, 0.5, 0.1)
    assert list(metrics) == names_about(log, *about, drives=3)
    log.add("xi_d", np.zeros((samples, 2)), "m")
    log.add("xi_M", np.zeros((samples, 2)), "m")
    log.add("phi", np.zeros((samples, 3)), "rad")
    log.add("manifold_force", np.ones((samples, 6)), "N, Nm")
    log.add("wrench_ext", np.ones((samples, 6)), "N, Nm")
    log.add("notch_position", np.ones((samples, 2)), "m")
    metrics = path_following_metrics(log, 5e-5, 0.5, 0.1)
    assert list(metrics) == names_about(log, *about, drives=3)
    for name in ("max_manifold_force", "max_tangential_force", "max_external_force"):
        assert metrics[name].unit == "N"


def test_collection_has_what_the_log_allows():
    log = decaying_log()
    names = {"settling_time", "max_path_deviation", "rms_path_deviation", "static_path_deviation"}
    assert set(path_following_metrics(log, 5e-5, 0.5, 0.1)) == names
    log.add("tau_d", np.full((2001, 3), 2.0), "Nm", limits=2.0)
    log.add("eta_dot", np.full(2001, 0.2), "m/s")
    metrics = path_following_metrics(log, 5e-5, 0.5, 0.1)
    assert metrics["peak_torque_3"].value == 2.0
    assert metrics["saturated_samples"].value == 2001
    assert metrics["max_path_deviation_while_moving"].value == pytest.approx(
        START * math.exp(-RATE * 0.5)
    )
    assert metrics["settling_time"].unit == "s"


def test_what_exists_is_given():
    circle = Path(FourierCurve.circle([0, 0, 0], 0.2))
    metrics = shape_metrics(shape_report(circle))
    assert metrics["path_length"].value == pytest.approx(0.4 * np.pi)
    assert metrics["path_smallest_radius"].value == pytest.approx(0.2)
    assert {metric.unit for metric in metrics.values()} == {"m"}
    assert set(metrics) == {"path_length", "path_smallest_radius", "path_smallest_radius_at"}
    line = PiecewisePolynomialCurve.line([0, 0, 0], [1, 0, 0])
    straight = Path(line, OrientationCurve.fixed([1, 0, 0, 0], line.domain))
    assert set(shape_metrics(shape_report(straight))) == {"path_length", "path_angle_rate"}
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    path = path_from_waypoints(WaypointTable(points), smoothness=3, closed=True)
    report = shape_report(path)
    metrics = shape_metrics(report)
    assert metrics["path_distance_from_points"].value == report.distance_from_points
    assert metrics["path_distance_from_polygon"].value == report.distance_from_polygon
