"""Reference planned for the drives: slowed down where required, or time-optimal."""

import numpy as np

from diagrams.scenario import ReferenceParameters
from diagrams.station import Station
from experiments.results.feature import Feature, Raw
from experiments.results.run_log import FloatArray, RunLog, Signal
from pfsc_drake.control.planning.limiting import KINDS
from pfsc_drake.controller.planning.drive_plan import DrivePlan
from pfsc_drake.physics.driver import torque_rates
from reporting import style
from reporting.metrics import Metrics


def add_limits(log: RunLog, plan: DrivePlan) -> None:
    """Add the speed of a planned motion, and its share of each limit.

    Args:
        log: Log of the run.
        plan: Plan of its time-optimal reference.
    """
    limiting = plan.limiting
    assert limiting is not None  # it is the fastest
    at = np.clip(np.searchsorted(plan.times, log.time), 0, len(plan.times) - 1)
    log.add("speed_planned", plan.speed[at])
    log.add("limited_by", limiting.active[at], labels=["none", *limiting.names])
    log.add("limit_shares", limiting.by_kind[at], labels=list(KINDS))


def fastest_metrics(plan: DrivePlan) -> Metrics:
    """Return the duration of the fastest motion, and shares of the path by active limit.

    Args:
        plan: Plan of the reference; only the fastest has these metrics.
    """
    metrics, limiting = Metrics(), plan.limiting
    if limiting is None:
        return metrics
    steps = np.diff(plan.times, append=plan.times[-1])
    metrics.add("fastest_time", float(steps[plan.speed > 0.0].sum()))
    for name, part in limiting.path_shares(plan.speed * steps).items():
        metrics.add(f"limited_by_{name}", part)
    return metrics


def applied_torque_metrics(log: RunLog, plan: DrivePlan | None) -> Metrics:
    """Return the drives' torques in the fastest motion, for comparison with the plan.

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
    """Return a warning if commanded torques changed faster than the plan's limit.

    Args:
        log: Log of a run.
        plan: Plan of its reference.
        reference: Parameters of the reference.
    """
    if plan is None or plan.limiting is None or "tau_d" not in log or log.time.size < 2:
        return []
    torque, n = log["tau_d"], len(plan.limits) // 2
    allowed = torque_rates(reference.torque_rate, plan.limits[:n])
    applied, planned = (rates.max(axis=0) for rates in (_rates(log, torque), _planned(log, plan)))
    i = int(np.argmax(applied / allowed))
    if not applied[i] > allowed[i]:
        return []
    return [
        f"the commanded torque of axis {i + 1} changes by up to {applied[i]:,.0f} {torque.unit}/s, "
        f"planned {planned[i]:,.0f}, allowed {allowed[i]:,.0f} (reference.torque_rate): the "
        "difference is feedback, encoder noise and compensated friction; a drive with a rate limit "
        "tracks less accurately; a larger reference.reserve leaves a larger margin"
    ]


def _rates(log: RunLog, torque: Signal) -> FloatArray:
    """Return rates of torques from sample to sample, shape (samples - 1, N)."""
    return np.asarray(np.abs(np.diff(torque.values, axis=0)) / np.diff(log.time)[:, None])


def _planned(log: RunLog, plan: DrivePlan) -> FloatArray:
    """Return planned rates of torques over a tick, shape (samples, N)."""
    n, period = len(plan.limits) // 2, log.period
    ticks = np.arange(plan.times[0], plan.times[-1], period)
    torques = [np.interp(ticks, plan.times, torque) for torque in plan.demand[:, :n].T]
    return np.asarray(np.abs(np.diff(np.stack(torques, axis=1), axis=0)) / period)


def plan_metrics(plan: DrivePlan | None) -> Metrics:
    """Return a reference's share of the drives' limits, and its speed scaling.

    Args:
        plan: Plan of the reference, or None.
    """
    metrics = Metrics()
    if plan is None or not len(plan.times):
        return metrics
    joints = len(plan.limits) // 2
    metrics.update(fastest_metrics(plan))
    shares = {"planned" if plan.limiting else "asked": plan.requested_demand}
    if plan.is_slowed:
        shares["planned"] = plan.demand
        metrics.add("slowest_pace", float(plan.speed_scaling.min()))
        metrics.add("waiting_time", float(plan.waiting_time))
    # drives without known limits have no share of them
    limited = np.isfinite(plan.limits[:joints]).any()
    for name, demand in shares.items() if limited else ():
        share = np.max(np.abs(demand[:, :joints]) / plan.limits[:joints])
        metrics.add(f"{name}_torque_share", float(share))
    return metrics


def _add_plan(log: RunLog, station: Station, _raw: Raw) -> None:
    """Add speed scaling or limits of the planned reference, and the planned torques."""
    plan, n = station.task.drive_plan, station.robot.dimension
    if plan is None or not (plan.is_slowed or plan.limiting):
        return
    if plan.limiting is None:
        log.add("pace", np.interp(log.time, plan.times, plan.speed_scaling))
    else:
        add_limits(log, plan)
    expected = [np.interp(log.time, plan.times, torque) for torque in plan.demand[:, :n].T]
    log.add("tau_planned", np.array(expected).T)


def draw_fastest(log: RunLog) -> style.Drawing:
    """Draw the speed of the fastest motion over the path, coloured by active limit, and all shares.

    Args:
        log: With ``speed_planned``, ``limited_by`` and ``limit_shares``.
    """
    speed, shares = log["speed_planned"].values[:, 0], log["limit_shares"]
    limits = log["limited_by"]
    number = limits.values[:, 0].astype(int)
    travel = np.concatenate([[0.0], np.cumsum(np.diff(log.time) * (speed[1:] + speed[:-1]) / 2.0)])
    canvas, panels = style.make_panels(2)
    upper, lower = panels
    upper.plot(travel, speed, color=style.REFERENCE, linewidth=0.8)
    moving = speed > 0.0
    for k, value in enumerate(np.unique(number[moving & (number > 0)])):
        there = moving & (number == value)
        name = limits.labels[value].replace("_", " ")
        colour = f"C{k}"
        upper.plot(travel, np.where(there, speed, np.nan), color=colour, linewidth=2.6, label=name)
    upper.set(ylabel="speed in m/s", ylim=(0.0, None), title="Speed by active limit")
    style.add_legend(upper)
    for k, name in enumerate(shares.labels):
        taken = shares.values[:, k]
        if taken[moving].max(initial=0.0) > 0.0:
            lower.plot(travel[moving], taken[moving], color=f"C{k}", label=name)
    lower.set(
        xlabel="distance along the reference in m",
        ylabel="used / allowed",
        ylim=(0.0, 1.1),
        title="Largest share of each limit",
    )
    style.add_legend(lower)
    caption = (
        "Speed of the reference along the path. Colours: active limit of the nominal model: torque "
        "of a drive, speed of its joint, rate of its torque, or largest speed of the tool. Below: "
        "share of each kind of limit used by the motion."
    )
    return style.Drawing("fastest", "The fastest motion and its limits", caption, canvas)


def draw_speed_scaling(log: RunLog) -> style.Drawing:
    """Draw the speed scaling of the reference, and planned and applied drive torques."""
    limits = log["tau_d"].limits
    assert limits is not None  # a speed scaling requires limits
    planned, applied = (
        np.max(np.abs(log[name].values) / limits, axis=1) for name in ("tau_planned", "tau_d")
    )
    scaling = log["pace"].values[:, 0]
    canvas, panels = style.make_panels(2)
    panels[0].plot(log.time, scaling, color="C0")
    panels[0].set(ylabel="speed / requested speed", ylim=(0.0, 1.05), title="Speed scaling")
    panels[1].plot(log.time, applied, color="C1", label="applied")
    panels[1].plot(log.time, planned, "--", color=style.REFERENCE, label="planned")
    panels[1].set(
        ylabel="torque / limit", ylim=(0.0, None), title="Largest share of a drive's torque limit"
    )
    style.add_legend(panels[1])
    caption = (
        f"The reference is slowed down to {scaling.min():.2g} of the requested speed where a drive "
        "would exceed its limits. Below: largest planned and applied torque relative to a drive's "
        "limit."
    )
    return style.Drawing("pace", "Speed scaling of the reference", caption, canvas)


FEATURE = Feature(
    signals=_add_plan,
    metrics=lambda log, station, settings: (
        plan_metrics(station.task.drive_plan) | applied_torque_metrics(log, station.task.drive_plan)
    ),
    known=lambda station, settings: plan_metrics(station.task.drive_plan),
    warnings=lambda log, station, settings: rate_warnings(
        log, station.task.drive_plan, settings.reference
    ),
    figures={"pace": draw_speed_scaling, "fastest": draw_fastest},
)
