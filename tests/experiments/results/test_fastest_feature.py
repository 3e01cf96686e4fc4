"""Signals, metrics and figure of a fastest motion that was made up."""

import numpy as np
import pytest

from diagrams.scenario import ReferenceParameters
from experiments.results.fastest_feature import (
    add_limits,
    applied_torque_metrics,
    draw_fastest,
    plan_metrics,
    rate_warnings,
)
from experiments.results.run_log import RunLog
from pfsc_drake.control.planning.limiting import Limiting
from pfsc_drake.controller.planning.drive_plan import DrivePlan
from pfsc_drake.geometry import PiecewisePolynomialCurve

STEP, LIMITS = 0.01, np.array([10.0, 20.0, 3.0, 3.0])


@pytest.fixture(name="plan")
def fixture_plan():
    """A rest of 0.1 s, then 0.9 s at 0.5 m/s: drive 2 at its limit for a third of it."""
    motion = PiecewisePolynomialCurve([0.0, 0.1, 1.0], [[[0.2], [0.0]], [[0.2], [0.5]]])
    times = STEP * np.arange(101)
    demand = np.tile([3.0, 4.0, 1.0, 1.0], (101, 1))
    demand[times >= 0.7 - 1e-9, 1] = -14.0
    allowed = np.tile([7.0, 14.0, 2.85, 2.85], (101, 1))
    speed = 0.5 / 2.0 * (times >= 0.1)
    limiting = Limiting.of(demand, allowed, (1, STEP), np.full(2, np.inf), speed)
    ones = np.ones(101)
    return DrivePlan(times, demand, demand, LIMITS, ones, motion, [], limiting)


def test_metrics(plan):
    metrics = plan_metrics(plan)
    assert metrics["fastest_time"].value == pytest.approx(0.9, abs=1e-9)
    assert metrics["limited_by_torque_2"].value == pytest.approx(1.0 / 3.0)
    assert metrics["limited_by_none"].value == pytest.approx(2.0 / 3.0)
    assert metrics["planned_torque_share"].value == pytest.approx(0.7)
    assert "asked_torque_share" not in metrics and "slowest_pace" not in metrics


def test_signals_at_the_ticks_of_a_run(plan):
    log = RunLog(np.array([0.0, 0.05, 0.5, 0.9, 1.3]))
    add_limits(log, plan)
    assert log["speed_planned"].values[:, 0].tolist() == [0.0, 0.0, 0.5, 0.5, 0.5]
    active = log["limited_by"]
    names = [active.labels[k] for k in active.values[:, 0].astype(int)]
    assert names == ["none", "none", "none", "torque_2", "torque_2"]
    assert np.allclose(log["limit_shares"].values[2], [3.0 / 7.0, 1.0 / 2.85, 0.0, 0.25])


def test_what_was_given(plan):
    log = RunLog(plan.times)
    add_limits(log, plan)
    assert not applied_torque_metrics(log, plan)
    torque = np.zeros((101, 2))
    torque[40] = [-8.0, 1.0]
    log.add("tau_d", torque, limits=LIMITS[:2])
    metrics = applied_torque_metrics(log, plan)
    share = metrics["given_torque_share"]
    assert share.value == pytest.approx(0.8) and share.source == "at t = 0.400 s"
    # 8 Nm within a sample; 18 Nm are planned in one
    rate = metrics["given_torque_rate"]
    assert (rate.value, rate.unit) == (pytest.approx(800.0), "Nm/s")
    assert rate.source.startswith("axis 1 at t = 0.")
    assert metrics["planned_torque_rate"].value == pytest.approx(1800.0)


def test_torques_that_change_faster_than_allowed_are_reported(plan):
    log, reference = RunLog(plan.times), ReferenceParameters([0.0, 1.0], torque_rate=500.0)
    torque = np.zeros((101, 2))
    torque[40, 1] = -4.0
    log.add("tau_d", torque, limits=LIMITS[:2])
    assert rate_warnings(log, plan, reference) == []
    torque[60, 0] = 6.0
    log.add("tau_d", torque, limits=LIMITS[:2])
    (said,) = rate_warnings(log, plan, reference)
    assert said.startswith(
        "the commanded torque of axis 1 changes by up to 600 Nm/s, planned 0, allowed 500 "
    )
    assert rate_warnings(log, None, reference) == []


def test_figure(plan):
    log = RunLog(plan.times)
    add_limits(log, plan)
    drawing = draw_fastest(log)
    upper, lower = drawing.canvas.axes
    (coloured,) = [line for line in upper.lines if line.get_label() == "torque 2"]
    way, speed = coloured.get_data()
    there = way[np.isfinite(speed)]
    assert [there.min(), there.max()] == pytest.approx([0.3, 0.45], abs=0.01)
    assert {line.get_label() for line in lower.lines} == {"torque", "speed", "velocity"}
