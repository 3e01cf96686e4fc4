"""Warnings about encoders, obstacles and runs that end before leader and tool rest."""

import numpy as np
import pytest

from diagrams.builder import build_station
from diagrams.scenario.obstacles import CrossingParameters
from diagrams.warnings.part_warnings import obstacle_warnings, rest_warnings
from experiments.scenario_file import SCENARIO_DIRECTORY
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters
from pfsc_drake.physics.moving_obstacle import (
    ObstacleParameters,
    ObstacleSensorParameters,
    ObstacleWaypoint,
)
from pfsc_drake.robot.robot_model import mass_function
from tests.scenarios import shipped_scenario


@pytest.mark.slow(but=["0.29", "0.31"])
@pytest.mark.parametrize("share", [0.29, 0.31, 2.0])
def test_an_increment_that_becomes_a_jump_of_the_torque(load_exact_scenario, share):
    """Increments by which the drive of the worst joint would be asked for a share of its torque."""
    settings = load_exact_scenario("pfc_comau_6r")
    station = build_station(settings, SCENARIO_DIRECTORY)
    robot, q_J = station.robot, station.start_posture
    inertia = np.diag(np.array(mass_function(robot)(q_J))) + robot.D_M
    gain = station.law.stabilization.proportional[1].max()
    worst = np.max(inertia / robot.gather("effort_limit"))
    increments = 2.0 * np.pi * worst * gain / (share * settings.controller.sampling_time)
    settings.encoders.link_increments = [float(increments)]
    settings.encoders.difference_quotient = True
    said = [
        s for s in build_station(settings, SCENARIO_DIRECTORY).warnings if s.startswith("encoders:")
    ]
    if share < 0.3:
        assert said == []
    else:
        (sentence,) = said
        assert f"respond with {100.0 * share:.0f} % of the torque" in sentence


def _crossing(**watch):
    way = [ObstacleWaypoint(0.0, [0.0, 0.0, 0.0]), ObstacleWaypoint(1.0, [1.0, 0.0, 0.0])]
    sensor = ObstacleSensorParameters(position_noise=0.01, delay=0.06, period=0.02)
    return CrossingParameters([ObstacleParameters(way=way)], sensor, WatchParameters(**watch))


def test_nothing_is_said_where_it_is_right():
    assert obstacle_warnings(None) == []
    assert obstacle_warnings(_crossing(latency=0.08, uncertainty=0.052)) == []


def test_what_breaks_the_promise_is_named():
    (fast,) = obstacle_warnings(_crossing(latency=0.08, uncertainty=0.052, largest_speed=0.9))
    assert "moving[0] moves at up to 1 m/s" in fast
    (late,) = obstacle_warnings(_crossing(latency=0.07, uncertainty=0.052))
    assert "latency = 0.07 s" in late
    assert "0.08 s old" in late
    (noisy,) = obstacle_warnings(_crossing(latency=0.08, uncertainty=0.05))
    assert "uncertainty = 0.05 m" in noisy


def test_what_is_hastier_than_is_known_is_named():
    good = {"latency": 0.08, "uncertainty": 0.052, "largest_acceleration": 3.0}
    (hasty,) = obstacle_warnings(_crossing(**good))
    assert "moving[0] accelerates with up to inf m/s^2" in hasty
    crossing = _crossing(**good, velocity_uncertainty=0.2)
    crossing.moving[0].way = [
        ObstacleWaypoint(time, [x, 0.0, 0.0]) for time, x in [(0, 0), (1, 0), (2, 0.2), (3, 0.2)]
    ]
    (noisy,) = obstacle_warnings(crossing)
    assert "velocity_uncertainty = 0.2 m/s" in noisy


@pytest.mark.parametrize("name", ["teleop_region", "teleop_path", "teleop_plate", "teleop_tilt"])
def test_shipped_scenarios_come_to_rest(name):
    settings = shipped_scenario(name)
    assert rest_warnings(settings.teleoperation, settings.hand, settings.duration) == []


def test_a_longer_delay_takes_longer():
    settings = shipped_scenario("teleop_region")
    settings.teleoperation.channel.delay = 0.2
    (said,) = rest_warnings(settings.teleoperation, settings.hand, settings.duration)
    assert said.startswith("hand.release = 17.5 s")
    assert "round trips of 0.48 s" in said
    assert "0.3 s are left" in said
    assert rest_warnings(settings.teleoperation, settings.hand, 18.2) == []
    assert rest_warnings(settings.teleoperation, settings.hand, 17.0) == []  # before it lets go
    assert rest_warnings(settings.teleoperation, None, 18.0) == []
    assert rest_warnings(None, settings.hand, 18.0) == []
