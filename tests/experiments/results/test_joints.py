"""Joints: limits of a run, positions, velocities and deflection."""

import math

import numpy as np
import pytest

from diagrams.builder import build_station
from diagrams.scenario import Scenario
from experiments.results.drives import draw_efforts
from experiments.results.friction import draw_friction
from experiments.results.joints import (
    DriveLimitsOfRun,
    draw_deflection,
    draw_positions,
    draw_velocities,
)
from experiments.results.run_log import RunLog
from experiments.scenario_file import find_scenario
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.links import ChainLink
from pfsc_drake.yaml.typed import load_file
from reporting.style import ALERT
from tests.shades import spans

INF = np.inf


def limits(position, velocity, revolute=(True, True)):
    return DriveLimitsOfRun(
        [f"j{i}" for i in range(len(velocity))],
        np.array(revolute),
        np.array(position, dtype=float),
        np.array(velocity, dtype=float),
    )


@pytest.fixture
def log():
    """Four samples 0.1 s apart: q_1 rises to 1.3, q_2 falls to -0.5 and comes back."""
    log = RunLog(0.1 * np.arange(4.0))
    log.add("q_J", [[0.0, 0.5], [0.9, 0.1], [1.3, -0.5], [1.2, 0.0]], "rad")
    log.add("v_J", [[0.0, -1.0], [5.0, -4.0], [2.0, 1.0], [-6.0, 3.0]], "rad/s")
    return log


def test_nothing_without_limits(log):
    free = limits([[-INF, INF]] * 2, [INF, INF])
    assert free.metric_names() == []
    assert dict(free.metrics(log)) == {}
    assert free.warnings(log) == []


def test_within_limits(log):
    within = limits([[-2.0, 2.0], [-1.0, INF]], [INF, 8.0])
    metrics = within.metrics(log)
    assert list(metrics) == within.metric_names() == ["joint_limit_margin", "joint_velocity_share"]
    margin, share = metrics.values()
    # q_2 comes within 0.5 of -1, q_1 within 0.7 of 2
    assert margin.value == pytest.approx(0.5)
    assert (margin.unit, margin.source) == ("rad", "q_2 at t = 0.200 s")
    assert share.value == pytest.approx(4.0 / 8.0)
    assert (share.unit, share.source) == ("1", "q_2 at t = 0.100 s")
    assert within.warnings(log) == []


def test_beyond_limits(log):
    narrow = limits([[-1.0, 1.0], [-0.2, 1.0]], [5.5, 4.0])
    metrics = narrow.metrics(log)
    assert metrics["joint_limit_margin"].value == pytest.approx(-0.3)
    assert metrics["joint_velocity_share"].value == pytest.approx(6.0 / 5.5)
    assert metrics["joint_velocity_share"].source == "q_1 at t = 0.300 s"
    assert narrow.warnings(log) == [
        "joint 1 'j0' passes its limit of 57.3 deg at t = 0.200 s and reaches 74.5 deg at "
        "t = 0.200 s; the simulation lets it pass",
        "joint 2 'j1' passes its limit of -11.5 deg at t = 0.200 s and reaches -28.6 deg at "
        "t = 0.200 s; the simulation lets it pass",
        "joint 1 'j0' passes its speed limit of 315.1 deg/s at t = 0.300 s and reaches "
        "343.8 deg/s at t = 0.300 s; the simulation lets it pass",
    ]


def test_a_limit_that_is_reached_is_not_passed(log):
    exact = limits([[0.0, 1.3], [-0.5 + 1e-12, 0.5]], [6.0, 4.0 * (1.0 - 1e-12)])
    assert exact.warnings(log) == []
    assert exact.metrics(log)["joint_limit_margin"].value == pytest.approx(0.0, abs=1e-11)


def test_slides_and_joints_are_not_compared(log):
    both = limits([[-2.0, 2.0], [-0.6, 0.6]], [INF, 2.0], revolute=[True, False])
    metrics = both.metrics(log)
    assert list(metrics) == ["joint_limit_margin", "slide_limit_margin", "joint_velocity_share"]
    assert list(metrics) == both.metric_names()
    assert metrics["joint_limit_margin"].value == pytest.approx(0.7)
    assert metrics["slide_limit_margin"].value == pytest.approx(0.1)
    assert metrics["slide_limit_margin"].unit == "m"
    (warning,) = both.warnings(log)
    assert "speed limit of 2 m/s at t = 0.100 s and reaches 4 m/s" in warning


def test_what_is_no_number_does_not_count(log):
    some = limits([[-1.0, 1.0], [-1.0, 1.0]], [4.0, 8.0])
    log["q_J"].values[2:, 0] = math.nan
    log["v_J"].values[1, 0] = math.nan
    metrics = some.metrics(log)
    assert metrics["joint_limit_margin"].value == pytest.approx(0.1)
    assert metrics["joint_velocity_share"].value == pytest.approx(1.5)
    (warning,) = some.warnings(log)
    assert "t = 0.300 s" in warning
    log["q_J"].values[:] = math.nan
    assert math.isnan(some.metrics(log)["joint_limit_margin"].value)
    empty = RunLog(np.zeros(0))
    empty.add("q_J", np.zeros((0, 2)), "rad")
    empty.add("v_J", np.zeros((0, 2)), "rad/s")
    assert math.isnan(some.metrics(empty)["joint_velocity_share"].value)
    assert some.warnings(empty) == []


@pytest.mark.parametrize("name", ["pfc_elastic_3r", "pfc_delta"])
def test_limits_of_a_robot(name):
    path = find_scenario(name)
    robot = build_station(load_file(Scenario, path), path.parent).robot
    own = DriveLimitsOfRun.of(robot)
    margin = "joint_limit_margin" if name == "pfc_elastic_3r" else "slide_limit_margin"
    assert own.metric_names() == [margin, "joint_velocity_share"]
    np.testing.assert_array_equal(own.position, robot.gather("position_limits"))
    np.testing.assert_array_equal(own.velocity, robot.gather("velocity_limit"))
    assert own.names == list(robot.names)


def test_a_speed_limit_of_zero_is_none():
    def link(name, speed):
        body = (np.eye(3), np.zeros(3), np.array([0.0, 0.0, 1.0]), 1.0, np.zeros(3), np.eye(3))
        return ChainLink(name, "revolute", *body, velocity_limit=speed)

    own = DriveLimitsOfRun.of(SerialChain((link("a", 0.0), link("b", 2.0))))
    np.testing.assert_array_equal(own.velocity, [INF, 2.0])
    assert own.metric_names() == ["joint_velocity_share"]


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
