"""Figures of joint positions, drawn from made-up logs: panels, limits, postures."""

import numpy as np
import pytest

from experiments.figures.positions import draw_positions
from reporting.style import ALERT

# axis i of the log moves from 0 to i - 1 rad
ENDS = np.array([[-1.0, 1.0], [-9.0, 9.0], [-9.0, 2.2], [-9.0, 2.0], [-9, np.inf], [-99, 99.0]])


def bands(panel):
    """Lower and upper ends of what is grey over the whole time."""
    to_data = panel.transData.inverted()
    boxes = [patch.get_extents() for patch in panel.patches if not patch.get_label()]
    return [tuple(to_data.transform(box)[:, 1]) for box in boxes]


def test_all_in_one_panel_where_no_limit_is_near(drawn_log):
    drawing = draw_positions(drawn_log)
    (panel,) = drawing.canvas.axes
    assert "limit" not in drawing.caption
    assert panel.get_ylabel() == "position in deg"
    np.testing.assert_allclose(panel.lines[5].get_ydata()[-1], np.rad2deg(5.0))
    drawn_log["q_J"].unit = drawn_log["v_J"].unit = "m"
    drawing = draw_positions(drawn_log)
    assert drawing.title == "Slide positions"
    assert drawing.canvas.axes[0].get_ylabel() == "position in m"
    drawn_log["q_J"].unit = "rad or m"
    assert draw_positions(drawn_log).title == "Joint and slide positions"


def test_limits_within_reach_are_bands(drawn_log):
    """Axis 3 stays 0.2 below its limit, axis 4 passes it; the others are far away."""
    drawn_log["q_J"].limits = ENDS
    drawing = draw_positions(drawn_log)
    panels = drawing.canvas.axes
    assert len(panels) == 6
    dashed = [[line for line in p.lines if line.get_linestyle() == "--"] for p in panels]
    assert [len(lines) for lines in dashed] == [0, 0, 1, 1, 0, 0]
    levels = [dashed[i][0].get_ydata()[0] for i in (2, 3)]
    np.testing.assert_allclose(levels, np.rad2deg([2.2, 2.0]))
    assert dashed[3][0].get_color() == ALERT != dashed[2][0].get_color()
    for panel in panels[2:4]:
        low, high = panel.get_ylim()
        assert low < 0.0 < high
    beyond = [patch for patch in panels[3].patches if patch.get_label() == "beyond a limit"]
    begin, end = panels[3].transData.inverted().transform(beyond[0].get_extents())[:, 0]
    assert (begin, end) == pytest.approx((2.0 / 3.0, 1.0), abs=0.006)
    assert "grey beyond its limits, red where they are passed" in drawing.caption
    assert [len(bands(panel)) for panel in panels[:4]] == [0, 0, 1, 1]
    assert bands(panels[2])[0][0] == pytest.approx(np.rad2deg(2.2))


def test_spare_joints_have_panels_and_the_posture_is_dashed(drawn_log):
    """Six joints, three coordinates."""
    del drawn_log.signals["phi"]
    drawing = draw_positions(drawn_log)
    assert len(drawing.canvas.axes) == 6
    assert "out of sight" in drawing.caption
    drawn_log.add("q_posture", drawn_log["q_J"].values + 0.5, "rad")
    drawing = draw_positions(drawn_log)
    (dashed,) = [x for x in drawing.canvas.axes[1].lines if x.get_linestyle() == "--"]
    assert dashed.get_ydata()[-1] == pytest.approx(np.rad2deg(1.5))
    assert "dashed: the reference posture" in drawing.caption
