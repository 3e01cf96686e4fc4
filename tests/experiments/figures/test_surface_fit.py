"""The figure of points and the surface that was fitted to them."""

import numpy as np
import pytest

from experiments.figures.all import draw_figures
from experiments.figures.surface_fit import draw_surface_fit
from pfsc_drake.geometry.surfaces.residuals import Residuals

GENERATOR = np.random.default_rng(0)
FIT = Residuals(GENERATOR.uniform(0.0, 1.0, (500, 2)), 1e-3 * GENERATOR.normal(size=500))


def test_every_point_is_shown_where_it_is_and_counted():
    drawing = draw_surface_fit(FIT)
    over, counted = drawing.canvas.axes[:2]
    (dots,) = over.collections
    np.testing.assert_array_equal(dots.get_offsets(), FIT.theta)
    np.testing.assert_allclose(dots.get_array(), 1e3 * FIT.distances)
    low, high = dots.get_clim()
    assert low == -high < -1e3 * FIT.largest
    assert sum(bar.get_height() for bar in counted.patches) == 500
    assert "500 points" in drawing.caption
    marks = sorted(line.get_xdata()[0] for line in counted.lines)
    assert marks == pytest.approx([-1e3 * FIT.rms, 1e3 * FIT.rms])


def test_points_on_the_surface():
    drawing = draw_surface_fit(Residuals(FIT.theta, np.zeros(500)))
    assert "at most 0" in drawing.caption


def test_it_is_drawn_of_surfaces_that_were_fitted(drawn_log):
    names = [drawing.name for drawing in draw_figures(drawn_log, [np.zeros((2, 3))], FIT)]
    assert names[:2] == ["path", "surface_fit"]
    assert "surface_fit" not in [d.name for d in draw_figures(drawn_log, [np.zeros((2, 3))])]
