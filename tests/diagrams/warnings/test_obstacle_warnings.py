"""What is said of obstacles that are not what the controller takes them for."""

from diagrams.scenario.obstacles import CrossingParameters
from diagrams.warnings.obstacle_warnings import obstacle_warnings
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters
from pfsc_drake.physics.moving_obstacle import (
    ObstacleParameters,
    ObstacleSensorParameters,
    Stride,
)


def _crossing(**watch):
    way = [Stride(0.0, [0.0, 0.0, 0.0]), Stride(1.0, [1.0, 0.0, 0.0])]
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
        Stride(time, [x, 0.0, 0.0]) for time, x in [(0, 0), (1, 0), (2, 0.2), (3, 0.2)]
    ]
    (noisy,) = obstacle_warnings(crossing)
    assert "velocity_uncertainty = 0.2 m/s" in noisy
