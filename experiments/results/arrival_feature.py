"""Arrival of a motion: completed share at the end of a run.

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

# m, allowed distance from the goal of a tool that has arrived
_SHORT = 5e-3
# speed scaling of a reference below which the tool waits
_WAITS = 0.1
# samples for the length of a motion
_SAMPLES = 2001


def arrival_metrics(log: RunLog, task: Task, settings: Scenario) -> Metrics:
    """Return the completed share of the requested motion, if there is one.

    The remaining distance is the reference's distance to go, in its own time where it waits for
    obstacles, plus the tool's distance from the reference; the latter does not count where the tool
    complies along the path. The share is a requirement of runs with the scenario's full duration
    whose motion ends within that time.

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
    positions = motion.derivatives(times, 0)[:, 0]
    return float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())


FEATURE = Feature(
    metrics=lambda log, station, settings: arrival_metrics(log, station.task, settings)
)
