"""What limits the fastest motion, and where: its signals and metrics."""

import numpy as np

from diagrams.tasks.task import DrivePlan
from experiments.results.run_log import RunLog
from pfsc_drake.control.planning.limiting import KINDS
from reporting.metrics import Metrics


def add_limits(log: RunLog, plan: DrivePlan) -> None:
    """Add how fast a planned motion is, and what of each limit it takes.

    Args:
        log: Log of the run.
        plan: Plan of its reference, the fastest.
    """
    limiting = plan.limiting
    assert limiting is not None  # it is the fastest
    at = np.clip(np.searchsorted(plan.times, log.time), 0, len(plan.times) - 1)
    log.add("speed_planned", plan.speed[at])
    log.add("limited_by", limiting.active[at], labels=["none", *limiting.names])
    log.add("limit_shares", limiting.by_kind[at], labels=list(KINDS))


def fastest_metrics(plan: DrivePlan) -> Metrics:
    """Return how long the fastest motion takes, and on what share of the way each limit is at work.

    Args:
        plan: The plan of a reference; others than the fastest have none.
    """
    metrics, limiting = Metrics(), plan.limiting
    if limiting is None:
        return metrics
    steps = np.diff(plan.times, append=plan.times[-1])
    metrics.add("fastest_time", float(steps[plan.speed > 0.0].sum()))
    for name, part in limiting.of_the_way(plan.speed * steps).items():
        metrics.add(f"limited_by_{name}", part)
    return metrics


def given_metrics(log: RunLog) -> Metrics:
    """Return what drives gave for the fastest motion, to be compared with what was planned.

    Args:
        log: Log of a run.
    """
    metrics = Metrics()
    if "speed_planned" not in log or "tau_d" not in log:
        return metrics
    torque = log["tau_d"]
    if torque.limits is not None and len(torque.values):
        share = np.max(np.abs(torque.values) / torque.limits, axis=1)
        k = int(share.argmax())
        metrics.add("given_torque_share", float(share[k]), source=f"at t = {log.time[k]:.3f} s")
    return metrics
