"""Metrics of a hand that leads a robot to where it cannot go on."""

import numpy as np

from diagrams.station import Station
from experiments.results.run_log import RunLog
from reporting.metrics import Metrics

_NAMES = ["time_at_limits", "largest_limit_force"]


def limit_metrics(log: RunLog) -> Metrics:
    """Return for how long, and how hard, the robot's own limits held the hand.

    Args:
        log: Of a run; without ``limit_force`` there are no such metrics.
    """
    metrics = Metrics()
    if "limit_force" not in log or log.time.size < 2:
        return metrics
    forces = np.nan_to_num(log["limit_force"].values)
    period = float(np.median(np.diff(log.time)))
    held = np.count_nonzero(np.any(forces > 0.0, axis=1))
    metrics.add("time_at_limits", held * period, "s")
    metrics.add("largest_limit_force", float(np.max(forces)), "N")
    return metrics


def limit_metric_names(station: Station) -> list[str]:
    """Return the names of these metrics; none where no hand leads the tool.

    Args:
        station: The station, simulated or not.
    """
    rows = station.log.rows
    return _NAMES if "guidance" in rows or "limit_force" in rows else []
