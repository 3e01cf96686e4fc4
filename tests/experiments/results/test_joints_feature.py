"""Figures of positions, velocities and deflection, drawn from made-up logs."""

import numpy as np
import pytest

from experiments.results.drives_feature import draw_efforts
from experiments.results.friction_feature import draw_friction
from experiments.results.joints_feature import (
    draw_deflection,
    draw_positions,
    draw_velocities,
)
from reporting.style import ALERT
from tests.shades import spans


def set_units(log, units):
    for name, unit in units.items():
        log[name].unit = unit


SLIDES = {"q_J": "m", "q_M": "m", "v_J": "m/s", "v_M": "m/s", "tau_d": "N", "tau_f": "N"}


MIXED = {
    "q_J": "rad or m",
    "q_M": "rad or m",
    "v_J": "rad/s or m/s",
    "v_M": "rad/s or m/s",
    "tau_d": "Nm or N",
    "tau_f": "Nm or N",
}


def words(drawing):
    """All that a person reads in a figure."""
    texts = [drawing.name, drawing.title, drawing.caption]
    for panel in drawing.canvas.axes:
        texts += [panel.get_title(), panel.get_ylabel()]
        texts += panel.get_legend_handles_labels()[1]
    return " ".join(texts).lower()


@pytest.mark.parametrize("draw", [draw_velocities, draw_efforts, draw_friction])
@pytest.mark.parametrize("motors", [True, False])
def test_slides_have_forces_and_no_joints(drawn_log, draw, motors):
    set_units(drawn_log, SLIDES)
    if not motors:
        del drawn_log.signals["v_M"]
    text = words(draw(drawn_log))
    assert "torque" not in text
    assert "joint" not in text
    assert "nm" not in text.split()


def test_words_for_slides(drawn_log):
    set_units(drawn_log, SLIDES)
    del drawn_log.signals["v_M"]
    efforts, velocities = draw_efforts(drawn_log), draw_velocities(drawn_log)
    assert (efforts.name, efforts.title) == ("drive_forces", "Drive forces")
    assert efforts.canvas.axes[0].get_ylabel() == "force in N"
    assert velocities.title == "Slide velocities"
    assert velocities.canvas.axes[0].get_title() == r"Slide velocities $\dot q_J$"
    assert velocities.canvas.axes[0].get_ylabel() == "velocity in m/s"
    friction = draw_friction(drawn_log).canvas.axes
    assert friction[0].get_ylabel() == "force in N"
    assert friction[6].get_ylabel() == "slide velocity\nin m/s"


@pytest.mark.slow
def test_words_for_joints(drawn_log):
    del drawn_log.signals["v_M"]
    for draw in (draw_velocities, draw_efforts, draw_friction):
        text = words(draw(drawn_log))
        assert "slide" not in text
        assert "force" not in text
        assert "motor" not in text
    assert draw_velocities(drawn_log).title == "Joint velocities"
    assert draw_efforts(drawn_log).name == "drive_torques"


def test_words_for_both_kinds_of_drives(drawn_log):
    set_units(drawn_log, MIXED)
    efforts = draw_efforts(drawn_log)
    assert efforts.name == "drive_torques_and_forces"
    assert efforts.canvas.axes[0].get_ylabel() == "torque or force\nin Nm or N"
    assert draw_velocities(drawn_log).title == "Joint and slide and motor velocities"
    assert "mrad or mm" in words(draw_deflection(drawn_log))


def test_motor_velocities_only_where_they_are_logged(drawn_log):
    drawn_log["v_M"].values = drawn_log["v_J"].values + 0.5
    drawing = draw_velocities(drawn_log)
    assert drawing.title == "Joint and motor velocities"
    assert len(drawing.canvas.axes) == 3
    for line in drawing.canvas.axes[2].lines:
        np.testing.assert_allclose(line.get_ydata(), 0.5)


def test_velocities_with_limits_within_reach(drawn_log):
    assert "limits" not in draw_velocities(drawn_log).caption
    drawn_log["v_J"].limits = np.array([9.0, 9.0, 3.0, 3.0, 9.0, 99.0])
    drawing = draw_velocities(drawn_log)
    dashed = [x for x in drawing.canvas.axes[0].lines if x.get_linestyle() == "--"]
    # up to 2, 3 and 4 rad/s
    assert [x.get_ydata()[0] for x in dashed] == [-3.0, 3.0, -3.0, 3.0]
    assert drawing.caption.endswith("limits within reach.")


def test_deflection_in_milliradians(drawn_log):
    drawn_log["q_M"].values = drawn_log["q_J"].values + 0.004
    (panel,) = draw_deflection(drawn_log).canvas.axes
    assert panel.get_ylabel() == "deflection in mrad"
    for line in panel.lines[1:]:
        np.testing.assert_allclose(line.get_ydata(), 4.0)


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
    assert "grey beyond its limits, red where they are exceeded" in drawing.caption
    assert [len(bands(panel)) for panel in panels[:4]] == [0, 0, 1, 1]
    assert bands(panels[2])[0][0] == pytest.approx(np.rad2deg(2.2))


def test_spare_joints_have_panels_and_the_posture_is_dashed(drawn_log):
    """Six joints, three coordinates."""
    del drawn_log.signals["phi"]
    drawing = draw_positions(drawn_log)
    assert len(drawing.canvas.axes) == 6
    assert "out of view" in drawing.caption
    drawn_log.add("q_posture", drawn_log["q_J"].values + 0.5, "rad")
    drawing = draw_positions(drawn_log)
    (dashed,) = [x for x in drawing.canvas.axes[1].lines if x.get_linestyle() == "--"]
    assert dashed.get_ydata()[-1] == pytest.approx(np.rad2deg(1.5))
    assert "dashed: the reference posture" in drawing.caption
