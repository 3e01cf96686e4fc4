"""Figures of posture, conditioning and pushes on links, drawn from made-up logs."""

import numpy as np
import pytest

from experiments.figures.all import draw_figures
from experiments.figures.posture import (
    draw_conditioning,
    draw_positions,
    draw_posture,
    draw_pushes,
    has_conditioning,
    has_pushes,
)
from reporting.style import ALERT
from tests.shades import shades, spans


def drawn(panel, label):
    (line,) = [line for line in panel.lines if line.get_label() == label]
    return np.asarray(line.get_ydata())


@pytest.fixture
def pushed_log(drawn_log):
    """Two points are pushed, the first from 0.4 to 0.6 s; it goes 3 mm and 4 mm away."""
    during = (drawn_log.time > 0.4) & (drawn_log.time < 0.6)
    force = np.outer(during, [0.0, 30.0, 0.0, 1.0, 0.0, 0.0])
    labels = [f"{name} {axis}" for name in ("link_4", "hand") for axis in "xyz"]
    drawn_log.add("push_force", force, "N", labels)
    drawn_log.add("elbow", 0.5 + np.outer(during, [3e-3, 4e-3, 0.0]), "m", labels[:3])
    return drawn_log


def test_pushes_and_the_way_of_the_point(pushed_log):
    assert has_pushes(pushed_log)
    pushed_log["elbow"].values[0] += 1.0  # before the push it does not matter
    # it starts where it is at the first sample with a force
    pushed_log["elbow"].values[81] = 0.5
    panels = draw_pushes(pushed_log).canvas.axes
    titles = [panel.get_title() for panel in panels]
    assert titles[0] == "Force on link_4, world axes"
    assert titles[1] == "Force on hand, world axes"
    assert titles[2] == "Way of link_4 since the first push"
    assert drawn(panels[0], "$f_y$").max() == 30.0
    assert drawn(panels[2], "distance").max() == pytest.approx(5.0)
    assert not drawn(panels[2], "distance")[:81].any()


def test_the_way_is_compared_with_an_undisturbed_motion(pushed_log):
    pushed_log.add("elbow_undisturbed", pushed_log["elbow"].values - 0.001, "m")
    drawing = draw_pushes(pushed_log)
    assert drawn(drawing.canvas.axes[-1], "distance") == pytest.approx(3.0**0.5)
    assert "in the lap before" in drawing.caption


def test_no_push_no_figure(pushed_log):
    pushed_log["push_force"].values[:] = 0.0
    assert not has_pushes(pushed_log)


def test_posture_error_and_swivel_angle(pushed_log):
    pushed_log.add("q_posture", pushed_log["q_J"].values - 0.1, "rad")
    pushed_log.add("swivel", np.tile([0.2, 0.3], (201, 1)), "rad")
    panels = draw_posture(pushed_log).canvas.axes
    assert drawn(panels[0], "axis 3") == pytest.approx(np.rad2deg(0.1))
    assert drawn(panels[1], "swivel angle") == pytest.approx(np.rad2deg(0.2))
    assert drawn(panels[1], "reference") == pytest.approx(np.rad2deg(0.3))
    labels = [shown.get_label() for shown in shades(panels[0])]
    assert labels == ["tool pushed", "link pushed"]


def test_conditioning_over_time_and_path(drawn_log):
    drawn_log.add("rcond", np.full(201, 0.05), "1", limits=[[1e-3, np.inf]])
    assert not has_conditioning(drawn_log)  # as many joints as coordinates, far from singular
    drawn_log["rcond"].values[7] = 5e-3
    assert has_conditioning(drawn_log)
    drawn_log["rcond"].values[9] = 0.0  # of a law that stopped
    panels = draw_conditioning(drawn_log).canvas.axes
    assert panels[1].get_xlabel() == r"$\eta$ in m"
    assert panels[1].lines[0].get_xdata()[-1] == pytest.approx(0.3)
    for panel in panels:
        assert drawn(panel, "threshold")[0] == 1e-3
        assert np.isnan(drawn(panel, "conditioning")[9])
    drawn_log["rcond"].values[:] = 0.05
    del drawn_log.signals["phi"]
    assert has_conditioning(drawn_log)  # spare joints
    names = [drawing.name for drawing in draw_figures(drawn_log, [np.zeros((2, 3))])]
    assert "conditioning" in names


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
    (beyond,) = spans(panels[3], "beyond a limit")
    assert beyond == pytest.approx((2.0 / 3.0, 1.0), abs=0.006)
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
