"""The parts that figures are made of."""

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from reporting.style import (
    STYLE,
    add_legend,
    fitting_unit,
    flatten_rounding_errors,
    is_dwarfed,
    largest,
    make_panels,
    shade,
)
from tests.shades import shades, spans


def overlap(labels, title):
    """Whether title and legend of a panel overlap once drawn."""
    with matplotlib.rc_context(STYLE):
        canvas, (panel,) = make_panels(1)
        for label in labels:
            panel.plot([0.0, 1.0], [0.0, 1.0], label=label)
        panel.set_title(title)
        add_legend(panel)
        renderer = FigureCanvasAgg(canvas).get_renderer()
        canvas.draw(renderer)
        box = panel.get_legend().get_window_extent(renderer)
        (drawn,) = (text for text in panel.findobj(Text) if text.get_text() == title)
        assert box.y0 >= panel.get_window_extent(renderer).y1 - 1.0  # no data under it
        assert box.x0 >= 0.0
        return box.overlaps(drawn.get_window_extent(renderer))


@pytest.mark.parametrize(
    ("labels", "title"),
    [
        (["a"], "Short"),
        ([f"axis {i}" for i in range(6)], r"Joint and slide velocities $\dot q_J$"),
        (["sensor not tared", "sensor fault", "the force that acts"], "A title that is long " * 2),
        ([f"component {i}" for i in range(5)], "A title that is long " * 2),
    ],
)
def test_legend_leaves_title_and_data_free(labels, title):
    assert not overlap(labels, title)


def test_shades_where_something_holds():
    _, panels = make_panels(2)
    time = np.linspace(0.0, 1.0, 11)
    where = np.isin(np.arange(11), [0, 1, 5, 10])
    shade(panels, time, where, "holds", "red")
    for panel in panels:
        assert len(shades(panel)) == 1
        drawn = spans(panel)
        np.testing.assert_allclose(drawn, [[0.0, 0.2], [0.5, 0.6], [1.0, 1.0]], atol=1e-12)
    assert panels[0].get_legend_handles_labels()[1] == ["holds"]
    assert panels[1].get_legend_handles_labels()[1] == []


def test_what_flickers_is_one_shade():
    """A sample in two, for a long time, but with one gap that can be seen."""
    _, (panel,) = make_panels(1)
    time = np.arange(200_001) * 1e-3
    where = np.arange(len(time)) % 2 == 0
    where[100_000:101_000] = False
    shade([panel], time, where, "flickers", "red")
    np.testing.assert_allclose(spans(panel), [[0.0, 99.999], [101.0, 200.0]], atol=1e-9)
    where[:] = False
    shade([panel], time, where, "never", "red")
    assert len(shades(panel)) == 1


def test_units_that_fit():
    assert fitting_unit(np.array([2e-3, np.nan]), "m") == (1e3, "mm")
    assert fitting_unit(np.array([-2e-5]), "rad") == (1e6, "µrad")
    assert fitting_unit(np.zeros(3), "m") == (1e3, "mm")
    assert fitting_unit(np.array([-2e-16]), "m") == (1e3, "mm")


@pytest.mark.parametrize(("size", "flat"), [(2e-13, True), (2e-6, False), (0.0, False)])
def test_rounding_errors_are_drawn_as_zero(size, flat):
    """The labels of the axis read -1 to 1, not a ten-thousandth of a nanometre."""
    _, (panel,) = make_panels(1)
    panel.plot([0.0, 1.0, 2.0], [0.0, size, -size])
    before = panel.get_ylim()
    flatten_rounding_errors(panel)
    assert panel.get_ylim() == ((-1.0, 1.0) if flat else before)


def test_largest_skips_what_is_not_finite():
    assert largest(np.array([[1.0, -3.0], [np.nan, -np.inf]])) == 3.0
    assert largest(np.full(2, np.nan)) == 0.0
    assert largest(np.zeros((0, 3))) == 0.0


def test_dwarfed_by_the_first_quarter():
    time = np.linspace(0.0, 1.0, 101)
    assert is_dwarfed(time, np.where(time < 0.2, 5.0, 1.0)[:, None], 4.0)
    assert not is_dwarfed(time, np.where(time < 0.2, 3.0, 1.0)[:, None], 4.0)
    assert not is_dwarfed(time, np.where(time < 0.3, 5.0, 1.0)[:, None], 4.0)
    assert not is_dwarfed(time, np.where(time < 0.2, 5.0, 0.0)[:, None], 4.0)
