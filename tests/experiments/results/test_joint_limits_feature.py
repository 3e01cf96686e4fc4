"""Limits of joints: how near a run comes to them."""

import math

import numpy as np
import pytest

from diagrams.builder import build_station
from diagrams.scenario import Scenario
from experiments.results.joint_limits_feature import (
    DriveLimitsOfRun,
)
from experiments.results.run_log import RunLog
from experiments.scenario_file import find_scenario
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.links import ChainLink
from pfsc_drake.yaml.typed import load_file

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
        "joint 1 'j0' exceeds its limit of 57.3 deg at t = 0.200 s and reaches 74.5 deg at "
        "t = 0.200 s; the simulation does not stop it",
        "joint 2 'j1' exceeds its limit of -11.5 deg at t = 0.200 s and reaches -28.6 deg at "
        "t = 0.200 s; the simulation does not stop it",
        "joint 1 'j0' exceeds its speed limit of 315.1 deg/s at t = 0.300 s and reaches "
        "343.8 deg/s at t = 0.300 s; the simulation does not stop it",
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
