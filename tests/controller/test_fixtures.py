"""Regions near a hand-guided tool, as an expression or by a schedule."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.control.fixtures.command_dynamics import FilterDynamics, ServoDynamics
from pfsc_drake.control.fixtures.fixture_parameters import Admittance, Fixture
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.controller import fixtures as fixtures_module
from pfsc_drake.controller.fixtures import _robot_limits, make_command_dynamics, near_expression
from pfsc_drake.controller.options.follower_options import FixtureOptions
from pfsc_drake.controller.tasks.space_task import SpaceTask
from pfsc_drake.geometry import torus
from pfsc_drake.geometry.regions.surface_region import SurfaceRegion
from pfsc_drake.geometry.shapes.sphere import SphereRegion

PERIOD = 1e-3
BALL = SphereRegion((0.0, 0.0, 0.0), 0.1, inside=False)


def guided(regions, distance_evaluations=0):
    options = FixtureOptions(distance_evaluations=distance_evaluations)
    command_dynamics = make_command_dynamics(2, options, PERIOD, lag=0.0, delay=0.0)
    fixtures = [Fixture(region) for region in regions]
    motion = Admittance(3.0, 60.0, PERIOD)
    return SpaceTask(SpaceManifold(2), np.zeros(3), fixtures, motion, command_dynamics, options, {})


def test_what_has_no_formula_is_left_to_a_schedule():
    fitted = SurfaceRegion(torus(0.3, 0.1), above=True)
    assert isinstance(near_expression(guided([BALL])), ca.Function)
    assert near_expression(guided([BALL, fitted])) is None


def test_many_regions_and_those_on_a_budget_are_left_to_a_schedule():
    assert isinstance(near_expression(guided([BALL] * 8)), ca.Function)
    assert near_expression(guided([BALL] * 9)) is None
    assert near_expression(guided([BALL], distance_evaluations=2)) is None


def test_before_servos_their_lag_counts_before_torques_a_filter():
    options = FixtureOptions(smoothing=0.004)
    servo = make_command_dynamics(1, options, PERIOD, lag=0.005, delay=0.002)
    assert isinstance(servo, ServoDynamics)
    assert servo.lag == pytest.approx(0.007)
    filtered = make_command_dynamics(3, options, PERIOD, lag=0.005, delay=0.002)
    assert isinstance(filtered, FilterDynamics)
    assert filtered.lag == pytest.approx(0.008)


def test_robot_limits_are_for_tools_as_fast_as_regions_that_push_them(monkeypatch):
    monkeypatch.setattr(fixtures_module, "RobotLimits", lambda *given, **more: (given, more))
    led = guided([BALL, BALL])
    led.speeds = [0.05, 0.3]
    (_, limits, _), more = _robot_limits(led, None, None)
    assert limits is led.options.limits
    assert more["fastest"] == led.options.guidance.largest_speed + 0.3
    led.options.limits.on = False
    assert _robot_limits(led, None, None) is None
