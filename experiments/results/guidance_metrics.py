"""Metrics of a tool that is led by hand within virtual fixtures, from its log alone."""

import numpy as np

from diagrams.station import Station
from experiments.results.guidance_audit import AUDITED
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.fixtures.record import SLOT, Mode
from reporting.metrics import Metrics


def guidance_metrics(log: RunLog) -> Metrics:
    """Return how well forbidden regions were respected, and what that cost.

    Args:
        log: Of a run; without ``region_distance`` there are no such metrics.
    """
    metrics = Metrics()
    if "region_distance" not in log or not log.time.size:
        return metrics
    if "phi" in log:  # a tool that a hand turns is where it is asked to be, not at zero
        error = np.linalg.norm(log["phi"].values - log["phi_p"].values, axis=1)
        metrics.add("max_orientation_error", float(np.nanmax(error)), "rad")
    distance, soft = log["region_distance"].values, soft_regions(log)
    hard = np.setdiff1d(np.arange(distance.shape[1]), soft)
    if hard.size:
        metrics.add("deepest_violation", deepest_violation(distance[:, hard]), "m")
    if soft.size:
        metrics.add(
            "deepest_in_soft", max(0.0, float(-np.nanmin(distance[:, soft], initial=np.inf))), "m"
        )
    command = log["velocity_command"].values
    steps = np.linalg.norm(np.diff(command, axis=0), axis=1)
    metrics.add("largest_command_step", float(np.nanmax(steps, initial=0.0)), "m/s")
    metrics.add("largest_command", float(np.nanmax(np.linalg.norm(command, axis=1))), "m/s")
    period = float(np.median(np.diff(log.time))) if log.time.size > 1 else 0.0
    power = np.sum(log["guiding_force"].values * command, axis=1)
    # the least that the hand has given up to any instant: what it got out of the fixtures
    metrics.add("energy_from_fixtures", max(0.0, float(-np.nanmin(np.cumsum(power)) * period)), "J")
    metrics.add("least_tank", float(np.nanmin(log["tank"].values)), "J")
    modes = log["mode"].values[:, 0]
    changes = np.count_nonzero(np.diff(modes))
    metrics.add("mode_changes_per_second", changes / max(log.time[-1], period), "1/s")
    for number, name in enumerate(log["mode"].labels):
        metrics.add(f"time_{name}", float(np.count_nonzero(modes == number) * period), "s")
    evaluated = log["region_evaluated"].values.sum(axis=1)
    metrics.add("distances_per_tick", float(evaluated.mean()), "1", source="mean")
    metrics.add("distances_per_tick_max", float(evaluated.max()), "1")
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


def guidance_metric_names(station: Station) -> list[str]:
    """Return the names of the metrics of a station's run within fixtures; none without.

    Args:
        station: The station, simulated or not.
    """
    if "guidance" not in station.log.rows:
        return []
    times = [f"time_{mode.name.lower()}" for mode in Mode]
    return [
        "deepest_violation",
        "deepest_in_soft",
        "largest_command_step",
        "largest_command",
        "energy_from_fixtures",
        "least_tank",
        "mode_changes_per_second",
        *times,
        "distances_per_tick",
        "distances_per_tick_max",
        *AUDITED,
    ]


def soft_regions(log: RunLog) -> FloatArray:
    """Return the indices of regions that were near and soft.

    Args:
        log: With ``near_regions``.
    """
    slots = log["near_regions"].values.reshape(len(log.time), -1, len(SLOT))
    index, stiffness = slots[..., SLOT.index("index")], slots[..., SLOT.index("stiffness")]
    return np.unique(index[(stiffness > 0.0) & (index >= 0.0)]).astype(int)
