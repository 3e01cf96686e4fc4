"""Attracting paths: active guide, distance, force and stored energy."""

import numpy as np

from diagrams.station import Station
from experiments.results.feature import Feature, Raw
from experiments.results.forces_feature import shade_pushes
from experiments.results.run_log import RunLog
from pfsc_drake.control.fixtures.guides import GuideRecord
from pfsc_drake.controller.tasks.space_task import SpaceTask
from reporting import style
from reporting.metrics import Metrics

# names in the log of the record's fields
_SIGNALS = {
    "kappa": "guide_stiffness",
    "share": "guide_share",
    "energy": "guide_energy",
    "after": "guide_energy_after",
    "foot": "guide_foot",
}
# s, least active time of a followed guide
_FOLLOWED = 0.5
MILLI = 1e3


def add_guides(log: RunLog, station: Station, raw: Raw) -> None:
    """Add the active guide, and position along and actual distance from each guide.

    Args:
        log: Log of the run, which is extended, with ``rest_point`` and ``velocity_command``.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    task = station.task
    if "guides" not in raw or not isinstance(task, SpaceTask):
        return
    record, names = GuideRecord(len(task.guides)), list(task.guides)
    rows = {name: raw["guides"][:, part] for name, part in record.fields.items()}
    active = np.nan_to_num(rows["active"], nan=-1.0).astype(int) + 1
    log.add("guide", active, labels=["none", *names])
    for name, signal in _SIGNALS.items():
        log.add(signal, rows[name])
    after = log["rest_point"].values + log.period * log["velocity_command"].values
    log.add("guide_force", rows["kappa"] * (rows["foot"] - after))
    log.add("guide_eta", rows["eta"], labels=names)
    distances = [guide.distances(raw["true_pose"][:, :3]) for guide in task.guides.values()]
    log.add("guide_distance", np.reshape(distances, (len(names), -1)).T, labels=names)


def guide_metrics(log: RunLog) -> Metrics:
    """Return the number of followed guides, changes between them, and forces.

    Args:
        log: Log of a run; without ``guide`` there are no such metrics.
    """
    metrics = Metrics()
    if "guide" not in log or log.time.size < 2:
        return metrics
    active, T = log["guide"].values[:, 0], log.period
    numbers = np.arange(1, len(log["guide"].labels))
    times = np.array([np.count_nonzero(active == number) * T for number in numbers])
    metrics.add("guides_followed", float(np.count_nonzero(times > _FOLLOWED)))
    metrics.add("guide_changes", float(np.count_nonzero(np.diff(active))))
    metrics.add("time_without_guide", float(np.count_nonzero(active == 0) * T))
    steps = np.linalg.norm(np.diff(log["velocity_command"].values, axis=0), axis=1)
    changed = np.diff(active) != 0
    metrics.add("step_at_guide_change", float(np.nanmax(steps[changed], initial=0.0)))
    forces = log.norm("guide_force")
    metrics.add("largest_guide_force", float(np.nanmax(forces)))
    metrics.add("guide_rest_distance", float(np.nanmin(log["guide_distance"].values[-1])))
    return metrics


def draw_guides(log: RunLog) -> style.Drawing:
    """Draw the active guide, distances, position along it, forces and speed."""
    canvas, (which, distance, along, force, speed) = style.make_panels(5)
    names = log["guide"].labels
    active = log["guide"].values[:, 0]
    which.step(log.time, active, where="post", color=style.INK)
    which.set(title="Active guide", yticks=range(len(names)), ylim=(-0.3, len(names) - 0.7))
    which.set_yticklabels(names)
    distance.axhline(0.0, color=style.REFERENCE, linewidth=0.8)
    for k, name in enumerate(names[1:]):
        colour, pulls = f"C{k}", active == k + 1
        values = MILLI * log["guide_distance"].values[:, k]
        distance.plot(log.time, values, color=colour, linewidth=0.7, alpha=0.6)
        distance.plot(log.time, np.where(pulls, values, np.nan), color=colour, label=name)
        eta = np.where(pulls, log["guide_eta"].values[:, k], np.nan)
        along.plot(log.time, eta, color=colour, label=name)
    distance.set(title="Distance from the guides", ylabel="distance in mm")
    along.set(title="Position along the active guide", ylabel=r"$\eta$ in m")
    pull = log.norm("guide_force")
    hand = log.norm("guiding_force")
    force.plot(log.time, hand, color=style.INK, linewidth=0.8, label="operator")
    force.plot(log.time, pull, color="C1", label="guide")
    force.set(title="Forces", ylabel="force in N")
    command = log.norm("velocity_command")
    speed.plot(log.time, command, color="C0")
    speed.set(title="Commanded speed of the tool", ylabel="speed in m/s")
    shade_pushes([distance], log)
    for panel in (distance, force):
        style.add_legend(panel)
    caption = (
        "Active guide; actual distance of the tool from each guide, thick from the active one; "
        "position along it; forces of operator and guide; and commanded speed."
    )
    return style.Drawing("guides", "Attracting paths", caption, canvas)


FEATURE = Feature(
    signals=add_guides,
    metrics=lambda log, station, settings: guide_metrics(log),
    figures={"guides": draw_guides},
)
