"""Rows that no run has made."""

import pytest

from experiments.sweep.worker import COMPLETED, DIED, FAULT, RunRow
from reporting.metrics import Metrics


@pytest.fixture
def rows():
    """Six rows: four completed, one stopped by a fault, one whose process died."""
    made = {}
    for i, deviation in enumerate([3e-3, 1e-3, 7e-3, 2e-3]):
        metrics = Metrics()
        metrics.add("max_path_deviation", deviation, "m", "< 5e-3", "Sec. 3.8.3")
        metrics.add("joint_limit_margin", 0.1 * (i + 1), "rad")
        metrics.add("settling_time", float("nan") if i == 2 else 0.1, "s")
        metrics.add("real_time_factor", 3.0, "1", ">= 5")
        made[i] = RunRow(COMPLETED, "", metrics, ["slow"] if i == 1 else [], 1.0, 2.0, "a", "r1")
    metrics = Metrics()
    metrics.add("max_path_deviation", 9e-3, "m", "< 5e-3", "Sec. 3.8.3")
    made[4] = RunRow(FAULT, "singular", metrics, [], 0.3, 1.0, "b", "r1")
    made[5] = RunRow(DIED, "killed")
    return made
