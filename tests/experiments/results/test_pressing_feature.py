"""Pressing on a workpiece: metrics and figures, from made-up logs."""

import numpy as np
import pytest

from experiments.results.features import draw_figures
from experiments.results.pressing_feature import (
    SETTLING,
    draw_force_map,
    draw_pressing,
    press_metrics,
)
from experiments.results.run_log import RunLog
from tests.experiments.results.registry_names import names_about

TIME = np.linspace(0.0, 4.0, 401)


def make_log(force, press=None):
    log = RunLog(TIME)
    log.add("normal_force", force[:, None], "N", ["f_n"])
    if press is not None:
        log.add("press", press[:, None], "N", ["press"])
    return log


@pytest.fixture(name="press")
def fixture_press():
    return np.select([TIME < 0.5, TIME < 1.0, TIME < 3.0], [0.0, 5.0, 20.0], -5.0)


def test_overshoot_is_relative_to_the_reference_of_the_moment(press):
    force = np.where(TIME < 0.7, 0.0, np.maximum(press, 0.0))
    force[75] = 6.0  # 20 % of 5 N
    force[105] = 22.0  # 10 % of 20 N
    force[200] = 18.5
    metrics = press_metrics(make_log(force, press))
    assert metrics["touch_down"].value == pytest.approx(0.7)
    assert metrics["touch_down_overshoot"].value == pytest.approx(0.2)
    assert metrics["max_force_error"].value == pytest.approx(1.5)
    assert metrics["peak_force"].value == 22.0
    assert metrics["contact_losses"].value == 0.0
    assert list(metrics) == names_about(make_log(force, press), "normal_force")


def test_a_bounce_is_counted(press):
    force = np.where(TIME < 0.7, 0.0, np.maximum(press, 0.0))
    force[72:75] = force[80:82] = 0.0
    assert press_metrics(make_log(force, press))["contact_losses"].value == 2.0


def test_what_never_touches_has_no_overshoot(press):
    metrics = press_metrics(make_log(np.zeros_like(TIME), press))
    assert np.isnan(metrics["touch_down"].value)
    assert np.isnan(metrics["touch_down_overshoot"].value)


def test_position_control_has_a_peak_alone():
    log = make_log(np.full_like(TIME, 70.0))
    metrics = press_metrics(log)
    assert list(metrics) == names_about(log, "normal_force") == ["peak_force"]
    assert metrics["peak_force"].value == 70.0
    assert not press_metrics(RunLog(TIME))


def test_the_force_keeps_from_its_settling_after_the_touch_down(press):
    """The tool comes late: what it does before, and while it settles, is no error."""
    force = np.where(TIME < 1.8, 0.0, np.maximum(press, 0.0))
    force[185] = 12.0
    force[TIME > 1.8 + SETTLING + 0.1] -= 0.5 * (press[TIME > 1.8 + SETTLING + 0.1] > 0.0)
    metrics = press_metrics(make_log(force, press))
    assert metrics["touch_down"].value == pytest.approx(1.8)
    assert metrics["max_force_error"].value == pytest.approx(0.5)


DRAWN = np.linspace(0.0, 2.0, 201)


@pytest.fixture(name="log")
def fixture_log():
    log = RunLog(DRAWN)
    force = np.where(DRAWN < 0.5, 0.0, 19.0)
    log.add("normal_force", force[:, None], "N", ["f_n"])
    log.add("press", np.full((201, 1), 20.0), "N", ["press"])
    log.add("xi", np.full((201, 1), 2e-3), "m", ["xi"])
    log.add("eta", np.column_stack([0.1 * DRAWN, 0.0 * DRAWN]), "m", ["eta_1", "eta_2"])
    return log


def test_the_error_is_drawn_from_when_it_counts(log):
    error = draw_pressing(log).canvas.axes[1].lines[-1].get_ydata()
    assert np.isnan(error[DRAWN < 0.69]).all()
    np.testing.assert_allclose(error[DRAWN > 0.71], -1.0)


def test_the_map_has_the_force_where_it_touches(log):
    panel = draw_force_map(log).canvas.axes[0]
    (dots,) = panel.collections
    places = dots.get_offsets()
    assert places[:, 0].min() == pytest.approx(50.0)
    np.testing.assert_allclose(dots.get_array(), 19.0)
    assert dots.get_clim() == (18.0, 22.0)


def test_position_control_has_no_error(log):
    del log.signals["press"]
    assert len(draw_pressing(log).canvas.axes) == 2


def test_are_drawn_when_logged(log):
    names = [drawing.name for drawing in draw_figures(log, [np.zeros((2, 3))])]
    assert {"pressing", "force_map"} <= set(names)
