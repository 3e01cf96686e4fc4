"""A tool that is led by hand within virtual fixtures: its signals, metrics and warnings."""

import numpy as np
from numpy.typing import NDArray

from diagrams.scenario import Scenario
from diagrams.station import Station
from experiments.results.guides import add_guides
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.fixtures.program import SLOTS
from pfsc_drake.control.fixtures.record import SLOT, GuidanceRecord, Mode
from pfsc_drake.control.fixtures.robot_limits import limit_kinds
from pfsc_drake.following.tasks.space_task import SpaceTask
from reporting.metrics import Metrics

# name in the log of what the record has
_SINGLE = {
    "velocity": "velocity_command",
    "point": "rest_point",
    "force": "guiding_force",
    "clock": "region_clock",
    "rate": "region_rate",
    "spring": "spring_energy",
    "damping": "free_damping",
    "limit": "speed_limit",
    "squeezed": "squeezed",
}
# ticks over which motion is compared, and m/s by which it has to change meanwhile, rms
_SPAN, _MOVED = 20, 2e-3
# of the lag, and s, that it may be wrong by
_SHARE, _LEAST = 0.3, 1e-3
# m, from a region that leaves no room
_TIGHT = 1e-3


def add_guidance(
    log: RunLog, station: Station, raw: dict[str, FloatArray], y_t: FloatArray
) -> None:
    """Add modes, what the rules went by, and how far the tool truly is from each region.

    Args:
        log: To add to.
        station: The station that was simulated.
        raw: What it logged.
        y_t: True tool points [m], shape (samples, 3).
    """
    task = station.task
    if "guidance" not in raw or not isinstance(task, SpaceTask):
        return
    record = GuidanceRecord(len(task.fixtures))
    rows = {name: raw["guidance"][:, part] for name, part in record.fields.items()}
    modes = np.nan_to_num(rows["mode"]).astype(int)
    log.add("mode", modes, labels=[mode.name.lower() for mode in Mode])
    log.add("tank", rows["tank"], labels=["x"])
    for name, signal in _SINGLE.items():
        log.add(signal, rows[name])
    names = [fixture.name for fixture in task.fixtures]
    slots = [f"{key}_{slot}" for slot in range(SLOTS) for key in SLOT]
    log.add("near_regions", rows["near"], labels=slots)
    for name in ("labels", "evaluated", "on"):
        log.add(f"region_{name}", np.nan_to_num(rows[name]).astype(int), labels=names)
    distances = task.distances(y_t, region_times(log, task.lead.lag))
    distances[rows["on"] == 0.0] = np.nan  # a region that is switched off is nowhere
    log.add("region_distance", distances, labels=names)
    kinds, forces = limit_forces(rows["near"], len(names), station.robot.dimension)
    log.add("limit_force", forces, labels=kinds)
    add_guides(log, task, raw, y_t)


def limit_forces(near: FloatArray, regions: int, joints: int) -> tuple[list[str], FloatArray]:
    """Return by what forces the limits of the robot itself held the tool.

    Args:
        near: Slots as recorded, shape (samples, slots x 10).
        regions: Number of regions, behind which the limits are numbered.
        joints: N.

    Returns:
        Kinds of limits as in :func:`limit_kinds`, each once, and their forces [N], shape
        (samples, kinds).
    """
    all_kinds = limit_kinds(joints)
    kinds = list(dict.fromkeys(all_kinds))
    slots = near.reshape(len(near), near.shape[1] // len(SLOT), len(SLOT))
    index, phi = slots[..., SLOT.index("index")] - regions, slots[..., SLOT.index("phi")]
    forces = np.zeros((len(near), len(kinds)))
    for number, kind in enumerate(all_kinds):
        forces[:, kinds.index(kind)] += np.sum(np.where(index == number, phi, 0.0), axis=1)
    return kinds, forces


def region_times(log: RunLog, lag: float) -> FloatArray:
    """Return the clock of moving regions that the tool itself meets, shape (samples,).

    The rules look at where the tool will come to rest, and at the regions as they will be then.

    Args:
        log: With ``region_clock``.
        lag: How much later the tool is where the rules look [s].
    """
    clock = log["region_clock"].values[:, 0]
    if clock.size == 0:
        return clock
    return np.interp(log.time - lag, log.time, clock, left=clock[0] - lag)


def slots_of(log: RunLog, region: int) -> dict[str, FloatArray]:
    """Return what the log tells of a region while it was near, NaN else, each (samples, ..).

    Args:
        log: With ``near_regions``.
        region: Its index.

    Returns:
        By the names of ``SLOT``, the normal as ``n``, shape (samples, 3).
    """
    slots = log["near_regions"].values.reshape(len(log.time), -1, len(SLOT))
    values = np.full((len(log.time), len(SLOT)), np.nan)
    rows, where = np.nonzero(slots[..., 0] == region)
    values[rows] = slots[rows, where]
    columns = dict(zip(SLOT, values.T, strict=True))
    begin = SLOT.index("n_x")
    return columns | {"n": values[:, begin : begin + 3]}


def guidance_metrics(log: RunLog) -> Metrics:
    """Return how well forbidden regions were respected, and what that cost.

    Args:
        log: Log of a run; without ``region_distance`` there are no such metrics.
    """
    metrics = Metrics()
    if "region_distance" not in log or not log.time.size:
        return metrics
    if "phi" in log:  # a tool that a hand turns is where it is asked to be, not at zero
        error = np.linalg.norm(log["phi"].values - log["phi_p"].values, axis=1)
        metrics.add("max_orientation_error", float(np.nanmax(error)))
    distance, soft = log["region_distance"].values, soft_regions(log)
    hard = np.setdiff1d(np.arange(distance.shape[1]), soft)
    if hard.size:
        metrics.add("deepest_violation", deepest_violation(distance[:, hard]))
    if soft.size:
        metrics.add(
            "deepest_in_soft", max(0.0, float(-np.nanmin(distance[:, soft], initial=np.inf)))
        )
    command = log["velocity_command"].values
    steps = np.linalg.norm(np.diff(command, axis=0), axis=1)
    metrics.add("largest_command_step", float(np.nanmax(steps, initial=0.0)))
    metrics.add("largest_command", float(np.nanmax(np.linalg.norm(command, axis=1))))
    period = float(np.median(np.diff(log.time))) if log.time.size > 1 else 0.0
    power = np.sum(log["guiding_force"].values * command, axis=1)
    # the least that the hand has given up to any instant: what it got out of the fixtures
    metrics.add("energy_from_fixtures", max(0.0, float(-np.nanmin(np.cumsum(power)) * period)))
    metrics.add("least_tank", float(np.nanmin(log["tank"].values)))
    modes = log["mode"].values[:, 0]
    changes = np.count_nonzero(np.diff(modes))
    metrics.add("mode_changes_per_second", changes / max(log.time[-1], period))
    for number, name in enumerate(log["mode"].labels):
        metrics.add(f"time_{name}", float(np.count_nonzero(modes == number) * period))
    evaluated = log["region_evaluated"].values.sum(axis=1)
    metrics.add("distances_per_tick", float(evaluated.mean()))
    metrics.add("distances_per_tick_max", float(evaluated.max()))
    return metrics


def deepest_violation(distance: FloatArray) -> float:
    """Return how deep a tool came into regions [m]; 0 for one that stayed out.

    What it was in when it began, or when a region was switched on, is no violation as far as it
    only gets less from then on.

    Args:
        distance: From each region, NaN while that is switched off, shape (samples, M) [m].
    """
    deepest = 0.0
    for depth in np.maximum(-distance, 0.0).T:
        gone = np.isnan(depth)
        begins = np.flatnonzero(np.diff(gone, prepend=True) & ~gone)
        for part in np.split(depth, begins)[1:]:
            part = part[~np.isnan(part)]
            deepest = max(deepest, float(np.max(part - np.minimum.accumulate(part))))
    return deepest


def soft_regions(log: RunLog) -> FloatArray:
    """Return the indices of regions that were near and soft.

    Args:
        log: With ``near_regions``.
    """
    slots = log["near_regions"].values.reshape(len(log.time), -1, len(SLOT))
    index, stiffness = slots[..., SLOT.index("index")], slots[..., SLOT.index("stiffness")]
    return np.unique(index[(stiffness > 0.0) & (index >= 0.0)]).astype(int)


def limit_metrics(log: RunLog) -> Metrics:
    """Return for how long, and how hard, the robot's own limits held the hand.

    Args:
        log: Log of a run; without ``limit_force`` there are no such metrics.
    """
    metrics = Metrics()
    if "limit_force" not in log or log.time.size < 2:
        return metrics
    forces = np.nan_to_num(log["limit_force"].values)
    period = float(np.median(np.diff(log.time)))
    held = np.count_nonzero(np.any(forces > 0.0, axis=1))
    metrics.add("time_at_limits", held * period)
    metrics.add("largest_limit_force", float(np.max(forces)))
    return metrics


def guidance_warnings(log: RunLog, settings: Scenario) -> list[str]:
    """Return what a run within fixtures has shown to be otherwise, one sentence each.

    Args:
        log: Log of the run.
        settings: Its scenario.
    """
    if "squeezed" not in log or not log.time.size or settings.fixtures is None:
        return []
    return [*_squeezed(log), *_late_servos(log, settings)]


def observed_lag(log: RunLog, believed: float) -> float | None:
    """Return the lag of velocity servos, from what was asked of them and measured [s].

    The rules look at ``z = y + tau y' + T sum of commands under way``. Behind servos with
    ``y'' = (v - y') / tau`` it moves by T v in a tick. What it moves beside that is the error of
    ``tau`` times the change of ``y'``.

    Args:
        log: Log of a run with the law ``velocity_servo``.
        believed: ``tau`` [s].

    Returns:
        None where the tool hardly moved.
    """
    y = log["y_t_measured" if "y_t_measured" in log else "y_t"].values
    z, v = log["rest_point"].values, log["velocity_command"].values
    known = np.isfinite(v).all(axis=1)
    if np.count_nonzero(known) <= _SPAN:
        return None
    z, v, period = z[known], v[known], float(np.median(np.diff(log.time)))
    # what was asked at a tick counts from the next one on
    error = z - period * (np.cumsum(v, axis=0) - v)
    rate = np.gradient(y[known], period, axis=0)
    beside, change = (x[_SPAN:] - x[:-_SPAN] for x in (error, rate))
    if np.sqrt(np.mean(change**2)) < _MOVED:
        return None
    return believed - float(np.sum(beside * change) / np.sum(change**2))


def _late_servos(log: RunLog, settings: Scenario) -> list[str]:
    fixtures, servo = settings.fixtures, settings.servo
    if fixtures is None or settings.controller.law_record.commands_torque:
        return []
    believed = fixtures.lag_behind(servo.bandwidth)
    lag = observed_lag(log, believed)
    if lag is None or abs(lag - believed) <= max(_SHARE * believed, _LEAST):
        return []
    least = 2.0 * (lag + servo.bus_delay)
    return [
        f"the tool follows the asked velocity by {1e3 * lag:.2g} ms later, not by "
        f"{1e3 * believed:.2g} ms as fixtures.servo_lag has it (by default 1 / servo.bandwidth), "
        f"and so enters regions deeper: set it, and fixtures.guidance.approach_time to {least:.2g} "
        "s or more"
    ]


def _squeezed(log: RunLog) -> list[str]:
    ticks = np.flatnonzero(log["squeezed"].values[:, 0] > 0.5)
    if not ticks.size:
        return []
    distance = log["region_distance"]
    period = float(np.median(np.diff(log.time)))
    names = [
        name
        for i, name in enumerate(distance.labels or [])
        if np.any(_is_tight(slots_of(log, i))[ticks])
    ]
    deepest = -float(np.nanmin(distance.values[ticks], initial=0.0))
    return [
        f"{' and '.join(names)} squeezed the tool for {period * ticks.size:.3g} s from t = "
        f"{log.time[ticks[0]]:.3f} s on: no place near it is admitted by all of them, and it was "
        f"up to {1e3 * deepest:.2g} mm in one"
    ]


def _is_tight(slots: dict[str, FloatArray]) -> NDArray[np.bool_]:
    """Return when the tool was in a hard region, or all but, shape (samples,)."""
    return (slots["stiffness"] == 0.0) & (slots["h"] < _TIGHT)
