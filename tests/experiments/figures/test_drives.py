"""Figures of the drives, drawn from made-up logs: data, and words that fit the units."""

import numpy as np
import pytest

from experiments.figures.drives import (
    draw_deflection,
    draw_efforts,
    draw_friction,
    draw_velocities,
    draw_virtual_input,
    has_virtual_input,
)
from experiments.results.run_log import RunLog
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


def test_only_limits_within_reach_are_drawn(drawn_log):
    panels = draw_efforts(drawn_log).canvas.axes
    dashed = [
        [line.get_ydata()[0] for line in panel.lines if line.get_linestyle() == "--"]
        for panel in panels
    ]
    # Axis 3 of 1, 2, 3 Nm is the only one beyond half of 5 Nm in the first panel.
    assert dashed == [[-5.0, 5.0], [-5.0, 5.0] * 3]
    assert "limits" in draw_efforts(drawn_log).caption
    drawn_log["tau_d"].values *= 0.4  # 2.4 Nm at most
    assert "limits" not in draw_efforts(drawn_log).caption


def test_velocities_with_limits_within_reach(drawn_log):
    assert "limits" not in draw_velocities(drawn_log).caption
    drawn_log["v_J"].limits = np.array([9.0, 9.0, 3.0, 3.0, 9.0, 99.0])
    drawing = draw_velocities(drawn_log)
    dashed = [x for x in drawing.canvas.axes[0].lines if x.get_linestyle() == "--"]
    # up to 2, 3 and 4 rad/s
    assert [x.get_ydata()[0] for x in dashed] == [-3.0, 3.0, -3.0, 3.0]
    assert drawing.caption.endswith("limits within reach.")


def test_a_short_peak_does_not_hide_the_rest(drawn_log):
    drawn_log["tau_d"].values[:3, 0] = 100.0
    panels = draw_efforts(drawn_log).canvas.axes
    titles = [panel.get_title() for panel in panels]
    assert titles == [
        "Drive torques, axes 1 to 3",
        "The same, scaled to the last three quarters",
        "Drive torques, axes 4 to 6",
    ]
    late = np.abs(drawn_log["tau_d"].values[50:, :3]).max()
    assert panels[1].get_ylim() == pytest.approx((-1.2 * late, 1.2 * late))
    # axes 1 and 3 come near their limits, two lines each
    assert [len(panel.lines) for panel in panels[:2]] == [3 + 4, 3]


def test_friction_with_the_velocity_it_acts_on(drawn_log):
    """Both zeros at one height; at rest where the velocity is below a hundredth."""
    time = drawn_log.time
    drawn_log["v_M"].values = np.outer(np.clip(time - 0.5, -0.1, 0.1), np.full(6, 2.0))
    drawing = draw_friction(drawn_log)
    left, right = drawing.canvas.axes[2], drawing.canvas.axes[6 + 2]
    np.testing.assert_array_equal(left.lines[0].get_ydata(), drawn_log["tau_f"].values[:, 2])
    np.testing.assert_array_equal(right.lines[0].get_ydata(), drawn_log["v_M"].values[:, 2])
    assert left.get_ylabel() == "torque in Nm"
    assert right.get_ylabel() == "motor velocity\nin rad/s"
    for panel in (left, right):
        assert sum(panel.get_ylim()) == pytest.approx(0.0)
    assert spans(left) == [pytest.approx((0.5, 0.505))]


def test_deflection_in_milliradians(drawn_log):
    drawn_log["q_M"].values = drawn_log["q_J"].values + 0.004
    (panel,) = draw_deflection(drawn_log).canvas.axes
    assert panel.get_ylabel() == "deflection in mrad"
    for line in panel.lines[1:]:
        np.testing.assert_allclose(line.get_ydata(), 4.0)


TIME = np.linspace(0.0, 2.0, 201)


@pytest.fixture(name="log")
def fixture_log():
    """Two tangential and one transversal coordinate, of which the latter converges quickly."""
    log = RunLog(TIME)
    log.add("eta", np.zeros((201, 2)), "m", ["eta_1", "eta_2"])
    log.add("xi", np.zeros(201), "m", ["xi"])
    v = np.column_stack([np.sin(TIME), np.cos(TIME), -30.0 * np.exp(-20.0 * TIME)])
    log.add("virtual_input", v, "SI/s^2", ["v_eta_1", "v_eta_2", "v_xi"])
    return log


def test_each_kind_of_coordinates_has_its_panel(log):
    drawing = draw_virtual_input(log)
    tangential, transversal = drawing.canvas.axes
    shown = {line.get_label(): line.get_ydata() for line in tangential.lines[1:]}
    np.testing.assert_array_equal(shown[r"$v_{\eta_1}$"], np.sin(TIME))
    np.testing.assert_array_equal(shown[r"$v_{\eta_2}$"], np.cos(TIME))
    assert tangential.get_title() == "Tangential"
    assert tangential.get_ylabel() == "$v$ in m/s$^2$"
    assert "second time derivatives" in drawing.caption
    # the start would leave nothing to be seen of the rest
    assert transversal.get_title() == "Transversal, scaled to the last three quarters"
    assert transversal.get_ylim()[1] < 0.01


def test_of_velocity_servos_it_is_a_velocity(log):
    log["virtual_input"].unit = "SI/s^1"
    log.add("phi", np.zeros(201), "rad", ["phi_z"])
    log["virtual_input"].values = np.ones((201, 4))
    log["virtual_input"].labels.append("v_phi_z")
    drawing = draw_virtual_input(log)
    units = [panel.get_ylabel().removeprefix("$v$ in ") for panel in drawing.canvas.axes]
    assert units == ["m/s", "m/s", "rad/s"]
    assert "first time derivatives" in drawing.caption


def test_it_needs_coordinates(log):
    assert has_virtual_input(log)
    log.signals = {"virtual_input": log["virtual_input"]}
    assert not has_virtual_input(log)
