"""Random crossings: what is drawn, and what is made of the runs."""

import numpy as np
import pytest

from experiments.studies.crossings import random_crossings, summary
from experiments.sweep.worker import COMPLETED, RunRow
from pfsc_drake.physics.moving_obstacle import ObstacleParameters, ObstacleWaypoint
from reporting.metrics import Metrics


@pytest.mark.slow
def test_ways_cross_the_path_and_keep_away_from_the_start():
    for scenario in random_crossings(20, seed=3).values():
        (moving,) = scenario.data["obstacles"]["moving"]
        way = ObstacleParameters(
            way=[ObstacleWaypoint(x["time"], x["position"]) for x in moving["way"]]
        )
        assert way.largest_speed <= 1.6
        assert way.way[0].time <= 0.0
        curve = way.curve
        places = curve(np.linspace(curve.x[0], curve.x[-1], 2000))[:, :2]
        across = places[np.argmin(np.abs(places[:, 0] - 0.8))]
        assert -0.3 < across[1] < 0.7
        start = np.array([0.8, -0.7])
        assert np.linalg.norm(places - start, axis=1).min() > 0.25 + 0.1 + 0.29


def test_the_same_seed_draws_the_same():
    first, second = random_crossings(3), random_crossings(3)
    assert [s.data for s in first.values()] == [s.data for s in second.values()]
    assert first[0].data["obstacles"] != first[1].data["obstacles"]


def test_the_worst_of_all_runs_counts():
    rows = {}
    for k, (least, moving) in enumerate([(0.3, 0.6), (0.2, float("nan"))]):
        metrics = Metrics()
        for name, value in {
            "least_distance": least,
            "least_distance_while_moving": moving,
            "waited_time": 1.0 + k,
            "max_path_deviation": 1e-4,
            "largest_obstacle_speed": 1.0,
        }.items():
            metrics.add(name, value)
        rows[k] = RunRow(COMPLETED, "", metrics, [])
    found = summary(rows)
    assert found["worst least_distance"].value == pytest.approx(0.2)
    assert found["worst least_distance_while_moving"].value == pytest.approx(0.6)
    assert found["worst waited_time"].value == pytest.approx(2.0)
    assert found["crossings"].value == 2
