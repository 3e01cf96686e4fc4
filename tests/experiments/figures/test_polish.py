"""Forces on a workpiece, drawn from a made-up log."""

import numpy as np
import pytest

from experiments.figures.all import draw_figures
from experiments.figures.polish import draw_force_map, draw_pressing
from experiments.results.run_log import RunLog

TIME = np.linspace(0.0, 2.0, 201)


@pytest.fixture(name="log")
def fixture_log():
    log = RunLog(TIME)
    force = np.where(TIME < 0.5, 0.0, 19.0)
    log.add("normal_force", force[:, None], "N", ["f_n"])
    log.add("press", np.full((201, 1), 20.0), "N", ["press"])
    log.add("xi", np.full((201, 1), 2e-3), "m", ["xi"])
    log.add("eta", np.column_stack([0.1 * TIME, 0.0 * TIME]), "m", ["eta_1", "eta_2"])
    return log


def test_the_error_is_drawn_from_when_it_counts(log):
    error = draw_pressing(log).canvas.axes[1].lines[-1].get_ydata()
    assert np.isnan(error[TIME < 0.69]).all()
    np.testing.assert_allclose(error[TIME > 0.71], -1.0)


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
