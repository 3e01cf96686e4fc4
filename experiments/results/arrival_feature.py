"""Arrival of a motion: its share that is done at the end of a run.

Signals used, as in the log: ``eta``, ``eta_p`` [samples, k] m, ``time_lost`` [samples, 1] s,
``waiting_pace`` [samples, 1].
"""

import numpy as np

from diagrams.scenario import Scenario
from experiments.results.coordinates_feature import tangential_error
from experiments.results.feature import Feature
from experiments.results.run_log import RunLog
from pfsc_drake.controller.tasks.task import Task
from reporting.metrics import Metrics

# m, that a tool which has arrived may be short of its goal
_SHORT = 5e-3
# pace of a reference below which the tool waits
_WAITS = 0.1
# samples by which the length of a motion is measured
_SAMPLES = 2001


def arrival_metrics(log: RunLog, task: Task, settings: Scenario) -> Metrics:
    """Return the share of the requested motion that the tool has done, if it has one.

    What is left is the reference's distance to go, by its own time where it waits for obstacles,
    and how far the tool is from the reference; the latter does not count where the tool
    complies along the path. It is a requirement of runs that are as long as their scenario, where
    the motion ends within that time.

    Args:
        log: Log of a run.
        task: Its task.
        settings: Its scenario.
    """
    metrics, motion = Metrics(), task.motion
    assert motion is not None  # of a station's task
    end = motion.domain[1]
    if "eta" not in log or "eta_p" not in log or "way_left" in log or not log.time.size:
        return metrics
    length = _distance(task, 0.0)
    if length <= _SHORT:
        return metrics
    lost = float(log["time_lost"].values[-1, 0]) if "time_lost" in log else 0.0
    left = _distance(task, min(float(log.time[-1]) - lost, end))
    if "eta_d" not in log:
        left += tangential_error(log, float(log.time[-1]))
    tick = settings.controller.sampling_time
    timely = end <= settings.judged_after + 0.5 * tick
    lasted = float(log.time[-1]) > settings.judged_after - 1.5 * tick
    waits = "waiting_pace" in log and left > _SHORT and log["waiting_pace"].values[-1, 0] < _WAITS
    metrics.add(
        "arrived",
        max(0.0, 1.0 - left / length),
        target=f">= {1.0 - _SHORT / length:.6f}" if timely and lasted else None,
        source="the tool still waits for an obstacle" if waits else None,
    )
    return metrics


def _distance(task: Task, begin: float) -> float:
    """Return the distance that a motion travels from a time [s] on [m]."""
    motion = task.motion
    assert motion is not None  # of a station's task
    times = np.linspace(max(begin, motion.domain[0]), motion.domain[1], _SAMPLES)
    places = motion.derivatives(times, 0)[:, 0]
    return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())


FEATURE = Feature(
    metrics=lambda log, station, settings: arrival_metrics(log, station.task, settings)
)
