"""What limits the fastest motion, and where: its signals and metrics."""

import numpy as np

from diagrams.scenario import ReferenceParameters
from experiments.results.run_log import FloatArray, RunLog, Signal
from pfsc_drake.control.planning.limiting import KINDS
from pfsc_drake.following.planning.drive_plan import DrivePlan
from pfsc_drake.physics.driver import torque_rates
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


def given_metrics(log: RunLog, plan: DrivePlan | None) -> Metrics:
    """Return what drives gave for the fastest motion, to be compared with what was planned.

    Args:
        log: Log of a run.
        plan: Plan of its reference.
    """
    metrics = Metrics()
    if plan is None or "speed_planned" not in log or "tau_d" not in log:
        return metrics
    torque = log["tau_d"]
    if torque.limits is not None and len(torque.values):
        share = np.max(np.abs(torque.values) / torque.limits, axis=1)
        k = int(share.argmax())
        metrics.add("given_torque_share", float(share[k]), source=f"at t = {log.time[k]:.3f} s")
    if log.time.size > 1:
        unit, rates = f"{torque.unit}/s", _rates(log, torque)
        row, i = np.unravel_index(int(rates.argmax()), rates.shape)
        where = f"axis {i + 1} at t = {log.time[row]:.3f} s"
        metrics.add("planned_torque_rate", float(_planned(log, plan).max()), unit)
        metrics.add("given_torque_rate", float(rates[row, i]), unit, source=where)
    return metrics


def rate_warnings(log: RunLog, plan: DrivePlan | None, reference: ReferenceParameters) -> list[str]:
    """Return a sentence if commanded torques changed faster than the fastest motion may ask for.

    Args:
        log: Log of a run.
        plan: Plan of its reference.
        reference: What was asked of it.
    """
    if plan is None or plan.limiting is None or "tau_d" not in log or log.time.size < 2:
        return []
    torque, n = log["tau_d"], len(plan.limits) // 2
    allowed = torque_rates(reference.torque_rate, plan.limits[:n])
    given, planned = (rates.max(axis=0) for rates in (_rates(log, torque), _planned(log, plan)))
    i = int(np.argmax(given / allowed))
    if not given[i] > allowed[i]:
        return []
    return [
        f"the commanded torque of axis {i + 1} changes by up to {given[i]:,.0f} {torque.unit}/s, "
        f"planned {planned[i]:,.0f}, allowed {allowed[i]:,.0f} (reference.torque_rate): the rest "
        "is feedback, noise of encoders and compensated friction; a drive that limits the rate "
        "follows less well; a larger reference.reserve leaves more for it"
    ]


def _rates(log: RunLog, torque: Signal) -> FloatArray:
    """Return rates of torques from sample to sample, shape (samples - 1, N)."""
    return np.asarray(np.abs(np.diff(torque.values, axis=0)) / np.diff(log.time)[:, None])


def _planned(log: RunLog, plan: DrivePlan) -> FloatArray:
    """Return planned rates of torques over a tick, shape (samples, N)."""
    n, period = len(plan.limits) // 2, float(np.median(np.diff(log.time)))
    ticks = np.arange(plan.times[0], plan.times[-1], period)
    torques = [np.interp(ticks, plan.times, torque) for torque in plan.demand[:, :n].T]
    return np.asarray(np.abs(np.diff(np.stack(torques, axis=1), axis=0)) / period)
