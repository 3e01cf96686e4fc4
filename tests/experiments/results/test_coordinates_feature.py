"""Coordinates of the path or surface: their metrics and figures, from made-up logs."""

import math

import numpy as np
import pytest

from experiments.results.coordinates_feature import (
    draw_progress,
    draw_transversal,
    path_following_metrics,
    settling_time,
    tangential_error,
)
from experiments.results.drives_feature import drive_metrics
from experiments.results.forces_feature import force_metrics
from experiments.results.run_log import RunLog
from tests.experiments.results.registry_names import names_about
from tests.shades import spans

RATE = 8.0  # 1/s


START = 0.01  # m


STEP = 1e-3  # s


def decaying_log() -> RunLog:
    """Distance START exp(-RATE t), shared 3:4 by the two coordinates, over 2 s."""
    time = STEP * np.arange(2001)
    log = RunLog(time)
    log.add("xi", START * np.exp(-RATE * time)[:, None] * [0.6, -0.8], "m")
    return log


def following(log, name, begin=-math.inf, speed=0.1):
    """Return a metric of following from a time on, or from a speed on."""
    return path_following_metrics(log, 5e-5, begin, speed)[name].value


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
    name, expected = "max_path_deviation", START * math.exp(-RATE * 0.5)
    assert following(log, name, 0.5) == pytest.approx(expected)
    assert math.isnan(following(log, name, 3.0))


def test_deviation_while_moving():
    log = RunLog(np.arange(5.0))
    log.add("xi", np.array([[9, 0], [1, 0], [0, 2], [0, 7], [8, 0]]) * 1e-3, "m")
    log.add("eta_dot", [0.0, 1.0, -1.0, 0.2, 0.0], "m/s")
    name = "max_path_deviation_while_moving"
    assert following(log, name, speed=0.5) == pytest.approx(2e-3)
    assert following(log, name, speed=0.1) == pytest.approx(7e-3)
    assert math.isnan(following(log, name, 2.5, 0.5))


def test_rms_of_an_exponential():
    log = decaying_log()
    # Mean of START^2 exp(-2 RATE t) over [0, 2]; the sum over samples differs by O(STEP).
    exact = START * math.sqrt((1 - math.exp(-4 * RATE)) / (4 * RATE))
    assert following(log, "rms_path_deviation") == pytest.approx(exact, rel=5e-3)
    assert following(log, "rms_path_deviation", 1.0) < 1e-3 * exact


def test_static_deviation_is_the_mean_of_the_end():
    """Over 0.2 s."""
    time = 0.125 * np.arange(11)
    for begin, mean in ((1.1, 5e-3), (1.2, (1.0 + 5e-3) / 2)):
        log = RunLog(time)
        log.add("xi", np.where(time[:, None] > begin, [3e-3, 4e-3], [1.0, 0.0]), "m")
        assert following(log, "static_path_deviation") == pytest.approx(mean)


def test_orientation_speed_and_tangential_error():
    log = RunLog(np.arange(4.0))
    log.add("phi", np.array([[9, 0, 0], [1, 2, 2], [0, 0, 1], [0, 0, 0]]) * 1e-3, "rad")
    log.add("eta_dot", [0.1, -1.5, 1.2, 0.0], "m/s")
    log.add("eta", [0.0, 1.0, 2.0, 3.0], "m")
    log.add("eta_p", [0.0, 1.3, 1.9, 3.0], "m")
    assert following(log, "max_orientation_error", 1.0) == pytest.approx(3e-3)
    assert following(log, "peak_speed") == 1.5
    assert tangential_error(log) == pytest.approx(0.3)
    assert tangential_error(log, 2.0) == pytest.approx(0.1)


def collection(log):
    following = path_following_metrics(log, 5e-5, 0.5, 0.1)
    return following | drive_metrics(log) | force_metrics(log)


def test_names_are_those_of_the_collection():
    log = decaying_log()
    samples = len(log.time)
    log.add("xi_p", np.zeros((samples, 2)), "m")
    for name in ("eta", "eta_p", "eta_dot"):
        log.add(name, np.zeros(samples), "m")
    log.add("tau_d", np.ones((samples, 3)), "N")
    about = ("xi", "xi_d", "xi_M", "phi", "eta", "eta_dot", "tau_d")
    about += ("manifold_force", "wrench_ext", "notch_position")
    metrics = collection(log)
    assert list(metrics) == names_about(log, *about, drives=3)
    log.add("xi_d", np.zeros((samples, 2)), "m")
    log.add("xi_M", np.zeros((samples, 2)), "m")
    log.add("phi", np.zeros((samples, 3)), "rad")
    log.add("manifold_force", np.ones((samples, 6)), "N, Nm")
    log.add("wrench_ext", np.ones((samples, 6)), "N, Nm")
    log.add("notch_position", np.ones((samples, 2)), "m")
    metrics = collection(log)
    assert list(metrics) == names_about(log, *about, drives=3)
    for name in ("max_manifold_force", "max_tangential_force", "max_external_force"):
        assert metrics[name].unit == "N"


def test_collection_has_what_the_log_allows():
    log = decaying_log()
    names = {"settling_time", "max_path_deviation", "rms_path_deviation", "static_path_deviation"}
    assert set(collection(log)) == names
    log.add("tau_d", np.full((2001, 3), 2.0), "Nm", limits=2.0)
    log.add("eta_dot", np.full(2001, 0.2), "m/s")
    metrics = collection(log)
    assert metrics["peak_torque_3"].value == 2.0
    assert metrics["saturated_samples"].value == 2001
    assert metrics["max_path_deviation_while_moving"].value == pytest.approx(
        START * math.exp(-RATE * 0.5)
    )
    assert metrics["settling_time"].unit == "s"


def lines(panel):
    """Data of a panel by label; the zero line and other nameless ones are left out."""
    named = [line for line in panel.lines if not line.get_label().startswith("_")]
    return {line.get_label(): np.asarray(line.get_ydata()) for line in named}


def titles(drawing):
    return [panel.get_title() for panel in drawing.canvas.axes]


@pytest.fixture
def compliant_log(drawn_log):
    """References that yield: xi by 20 mm and 0, phi about z by 30 mrad, eta by 5 mm."""
    yielding = np.sin(np.pi * drawn_log.time) ** 2
    drawn_log["xi_p"].values = np.outer(yielding, [0.02, 0.0])
    drawn_log["xi"].values = drawn_log["xi_p"].values + np.array([2e-4, -1e-4])
    drawn_log.add("phi_p", np.outer(yielding, [0.03, 0.0, 0.0]), "rad")
    drawn_log["phi"].values = drawn_log["phi_p"].values + np.array([0.0, 0.0, 1e-3])
    drawn_log.add("eta_d", drawn_log["eta_p"].values - 5e-3 * yielding[:, None], "m")
    drawn_log.add("xi_d", np.zeros((201, 2)), "m")
    return drawn_log


def test_progress_shows_the_error(drawn_log):
    drawing = draw_progress(drawn_log)
    position, error, speed = drawing.canvas.axes
    np.testing.assert_allclose(lines(position)[r"$\eta$"], 0.3 * drawn_log.time)
    np.testing.assert_allclose(error.lines[0].get_ydata(), -1.0, atol=1e-9)
    assert error.get_ylabel() == "error in mm"
    np.testing.assert_allclose(speed.lines[0].get_ydata(), 0.3)
    assert "compliant" not in drawing.caption


def test_small_errors_are_in_micrometres(drawn_log):
    drawn_log["eta_p"].values = drawn_log["eta"].values - 2e-6
    error = draw_progress(drawn_log).canvas.axes[1]
    np.testing.assert_allclose(error.lines[0].get_ydata(), 2.0, rtol=1e-6)
    assert error.get_ylabel() == "error in µm"


def test_progress_shows_how_far_the_reference_yields(compliant_log):
    drawing = draw_progress(compliant_log)
    position, _, yielding, _ = drawing.canvas.axes
    assert r"$\eta^d$ (desired)" in lines(position)
    expected = 5.0 * np.sin(np.pi * compliant_log.time) ** 2
    np.testing.assert_allclose(yielding.lines[0].get_ydata(), expected, atol=1e-9)
    assert "mm" in yielding.get_ylabel()
    assert "compliant" in drawing.caption
    compliant_log["eta_d"].values = compliant_log["eta_p"].values.copy()
    assert len(draw_progress(compliant_log).canvas.axes) == 3


def test_transversal_is_enlarged_after_convergence(drawn_log):
    drawing = draw_transversal(drawn_log)
    panels = drawing.canvas.axes
    low, high = panels[1].get_ylim()
    late = 10.0 * np.exp(-9 * 0.25)  # mm, where the last three quarters begin
    assert (low, high) == pytest.approx((-1.2 * late, 1.2 * late))
    assert titles(drawing)[1] == "Enlarged, scaled to the last three quarters"
    assert panels[2].get_yscale() == "log"
    assert "reference" not in drawing.caption


def test_transversal_is_not_repeated_without_need(drawn_log):
    drawn_log["xi"].values[:] = [1e-3, 0.0]
    panels = draw_transversal(drawn_log).canvas.axes
    assert len(panels) == 2
    np.testing.assert_allclose(panels[1].lines[0].get_ydata(), 1.0)


def test_transversal_over_a_reference_that_yields(compliant_log):
    drawing = draw_transversal(compliant_log)
    position, error, distance = drawing.canvas.axes
    expected = 20.0 * np.sin(np.pi * compliant_log.time) ** 2
    reference = max(position.lines, key=lambda line: line.get_linewidth())
    np.testing.assert_allclose(reference.get_ydata(), expected, atol=1e-12)
    assert r"$\xi^p$ (reference)" in lines(position)
    assert not any("desired" in label for label in lines(position))  # zero throughout
    np.testing.assert_allclose(lines(error)[r"$\xi_1$"], 0.2, rtol=1e-9)
    np.testing.assert_allclose(lines(error)[r"$\xi_2$"], -0.1, rtol=1e-9)
    assert error.get_ylabel() == "deviation in mm"
    assert r"\xi - \xi^p" in titles(drawing)[1]
    sizes = lines(distance)
    np.testing.assert_allclose(sizes[r"from the reference $\|\xi - \xi^p\|$"], np.hypot(0.2, 0.1))
    assert sizes[r"$\|\xi\|$"].max() == pytest.approx(20.2, abs=0.01)


def test_transversal_with_a_desired_offset_and_motors(compliant_log):
    compliant_log["xi_d"].values[:, 1] = 3e-3
    compliant_log.add("xi_M", np.full((201, 2), 3e-3), "m")
    compliant_log.add("xi_measured", np.tile([3e-3, 4e-3], (201, 1)), "m")
    position, _, distance = draw_transversal(compliant_log).canvas.axes
    assert r"$\xi^d$ (desired)" in lines(position)
    dashed = {line.get_label(): line.get_ydata() for line in position.lines}
    np.testing.assert_allclose(dashed[r"_$\xi_2$"], 3.0)
    np.testing.assert_allclose(
        lines(distance)[r"of the motors $\|\xi_M\|$"], 3.0 * np.sqrt(2.0), rtol=1e-12
    )
    np.testing.assert_allclose(lines(distance)["as measured"], 5.0)


def test_references_of_rounding_errors_are_none(compliant_log):
    compliant_log["xi_p"].values[:] = 4e-16
    compliant_log["xi_d"].values[:] = -2e-16
    position, *_, distance = draw_transversal(compliant_log).canvas.axes
    assert set(lines(position)) == {r"$\xi_1$", r"$\xi_2$"}
    assert set(lines(distance)) == {r"$\|\xi\|$"}


def test_pushes_are_marked_in_other_figures(drawn_log):
    panels = draw_progress(drawn_log).canvas.axes
    assert spans(panels[0], "tool pushed") == [pytest.approx((0.405, 0.6))]
    assert all(len(spans(panel)) == 1 for panel in panels)
    force = drawn_log["wrench_ext"].values
    force[100:103] = 0.0  # a break of less than a fiftieth of the run
    assert len(spans(draw_progress(drawn_log).canvas.axes[0], "tool pushed")) == 1
    force[100:106] = 0.0
    assert len(spans(draw_progress(drawn_log).canvas.axes[0])) == 2
    del drawn_log.signals["wrench_ext"]
    assert not any(spans(panel) for panel in draw_progress(drawn_log).canvas.axes)
