"""Obstacles on their trajectories, and the sensor that measures them."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.errors import InputError
from pfsc_drake.physics.force_torque_sensor import NOISE_TICKS
from pfsc_drake.physics.moving_obstacle import (
    MovingObstacles,
    ObstacleParameters,
    ObstacleSensor,
    ObstacleSensorParameters,
    ObstacleWaypoint,
)

PERIOD = 1e-3
WAY = [
    ObstacleWaypoint(0.1, [0.0, 0.0, 0.0]),
    ObstacleWaypoint(0.6, [0.5, 0.2, 0.0]),
    ObstacleWaypoint(0.9, [0.5, 0.2, 0.0]),
    ObstacleWaypoint(1.3, [1.0, -0.4, 0.0]),
]


def _run(count=1600):
    stepper = Stepper(MovingObstacles([ObstacleParameters(way=WAY)], PERIOD))
    return np.array([stepper.step()["state"] for _ in range(count)])


def test_it_is_where_it_should_be_and_its_velocity_belongs_to_it():
    states = _run()
    for waypoint in WAY:
        position = states[round(waypoint.time / PERIOD), :3]
        np.testing.assert_allclose(position, waypoint.position, atol=1e-12)
    travelled = cumulative_trapezoid(states[:, 3:], dx=PERIOD, axis=0, initial=0.0)
    np.testing.assert_allclose(states[:, :3], travelled, atol=2e-3)
    standing = states[round(0.65 / PERIOD) : round(0.85 / PERIOD)]
    np.testing.assert_allclose(standing[:, 3:], 0.0, atol=1e-9)
    # before the first place and after the last it rests
    assert not states[:100, 3:].any()
    assert not states[1301:, 3:].any()


def test_its_largest_acceleration_is_that_of_its_velocity():
    stands = [*WAY, ObstacleWaypoint(2.0, WAY[-1].position)]
    soft = [ObstacleWaypoint(-0.5, [-0.2, 0.0, 0.0]), *stands[1:]]
    obstacle = ObstacleParameters(way=soft)
    times = np.linspace(0.0, 2.0, 20001)
    change = np.gradient(obstacle.curve(times, 1), times, axis=0)
    largest = np.linalg.norm(change, axis=1).max()
    assert obstacle.largest_acceleration == pytest.approx(largest, rel=2e-3)
    # who sets off at once, or stops so
    assert ObstacleParameters(way=stands).largest_acceleration == np.inf
    assert ObstacleParameters(way=[*soft[:-1]]).largest_acceleration == np.inf


def test_accelerations_before_the_start_of_time_do_not_count():
    """It runs at 3 m/s before, in part within a piece that goes on after 0."""
    waypoints = [
        ObstacleWaypoint(-2.0, [-3.0, 0.0, 0.0]), ObstacleWaypoint(-1.0, [0.0, 0.0, 0.0]),
        ObstacleWaypoint(-0.5, [0.8, 0.1, 0.0]), ObstacleWaypoint(0.5, [1.0, 0.2, 0.0]),
        ObstacleWaypoint(3.5, [1.4, 0.5, 0.0]), ObstacleWaypoint(5.5, [1.4, 0.5, 0.0]),
    ]  # fmt: skip
    obstacle = ObstacleParameters(way=waypoints)
    times = np.linspace(0.0, 5.5, 50001)
    change = np.linalg.norm(np.gradient(obstacle.curve(times, 1), times, axis=0), axis=1)
    before = np.linspace(-2.0, 0.0, 5001)
    earlier = np.linalg.norm(np.gradient(obstacle.curve(before, 1), before, axis=0), axis=1)
    assert earlier.max() > 2.0 * change.max()
    assert obstacle.largest_acceleration == pytest.approx(change.max(), rel=2e-3)


def test_its_largest_speed_is_known_beforehand():
    largest = np.linalg.norm(_run()[:, 3:], axis=1).max()
    assert ObstacleParameters(way=WAY).largest_speed == pytest.approx(largest, rel=1e-3)


@pytest.mark.parametrize("late", [0, 7])
def test_the_sensor_is_late_and_measures_now_and_then(late):
    every, deviation = 5, np.full(6, 0.1)
    sensor = Stepper(ObstacleSensor(1, every, late, deviation), ("noise",))
    rng = np.random.default_rng(1)
    noise = 0.1 * rng.normal(size=6 * NOISE_TICKS)
    states = np.array([[k, 0, 0, 1, 0, 0] for k in range(60)], dtype=float)
    outputs = np.array([sensor.step(state=x, noise=noise)["obstacles"] for x in states])
    np.testing.assert_array_equal(outputs[0], states[0])
    for k in range(late + every + 1, 60):
        then = (k - 1 - late) // every * every
        cut = np.clip(noise.reshape(-1, 6)[then], -0.3, 0.3)
        np.testing.assert_allclose(outputs[k], states[then] + cut, atol=1e-12)


def test_the_noise_of_several_obstacles():
    sensor = ObstacleSensorParameters(position_noise=0.01, velocity_noise=0.1)
    np.testing.assert_array_equal(sensor.deviation(2), np.tile([0.01] * 3 + [0.1] * 3, 2))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"way": WAY[:1]}, "way = 1 places"),
        ({"way": WAY[::-1]}, "ascending"),
        ({"kind": "cube"}, "kind"),
        ({"radius": -1.0}, "radius"),
    ],
)
def test_what_is_no_obstacle_is_refused(changes, message):
    with pytest.raises(InputError, match=message):
        ObstacleParameters(**changes)
    with pytest.raises(InputError, match="period"):
        ObstacleSensorParameters(period=0.0)
