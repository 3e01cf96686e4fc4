"""A tool that several paths attract: which one it follows, how near, and what that stores."""

import numpy as np

from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.fixtures.guides import GuideRecord
from pfsc_drake.following.tasks.space_task import SpaceTask
from reporting.metrics import Metrics

# name in the log of what the record has
_SIGNALS = {
    "kappa": "guide_stiffness",
    "share": "guide_share",
    "energy": "guide_energy",
    "after": "guide_energy_after",
    "foot": "guide_foot",
}
# s, for which a guide must have pulled to have been followed
_FOLLOWED = 0.5


def add_guides(log: RunLog, task: SpaceTask, raw: dict[str, FloatArray], y_t: FloatArray) -> None:
    """Add which guide pulled, where on each the tool was, and how far it truly was from each.

    Args:
        log: To add to, with ``rest_point`` and ``velocity_command``.
        task: What the tool was led through.
        raw: What the station logged.
        y_t: True tool points [m], shape (samples, 3).
    """
    if "guides" not in raw:
        return
    record, names = GuideRecord(len(task.guides)), list(task.guides)
    rows = {name: raw["guides"][:, part] for name, part in record.fields.items()}
    active = np.nan_to_num(rows["active"], nan=-1.0).astype(int) + 1
    log.add("guide", active, labels=["none", *names])
    for name, signal in _SIGNALS.items():
        log.add(signal, rows[name])
    after = log["rest_point"].values + _period(log) * log["velocity_command"].values
    log.add("guide_force", rows["kappa"] * (rows["foot"] - after))
    log.add("guide_eta", rows["eta"], labels=names)
    distances = [guide.distances(y_t) for guide in task.guides.values()]
    log.add("guide_distance", np.reshape(distances, (len(names), -1)).T, labels=names)


def _period(log: RunLog) -> float:
    return float(np.median(np.diff(log.time))) if log.time.size > 1 else 0.0


def guide_metrics(log: RunLog) -> Metrics:
    """Return which guides were followed, and what it took to change from one to the next.

    Args:
        log: Log of a run; without ``guide`` there are no such metrics.
    """
    metrics = Metrics()
    if "guide" not in log or log.time.size < 2:
        return metrics
    active, T = log["guide"].values[:, 0], _period(log)
    numbers = np.arange(1, len(log["guide"].labels))
    times = np.array([np.count_nonzero(active == number) * T for number in numbers])
    metrics.add("guides_followed", float(np.count_nonzero(times > _FOLLOWED)))
    metrics.add("guide_changes", float(np.count_nonzero(np.diff(active))))
    metrics.add("time_without_guide", float(np.count_nonzero(active == 0) * T))
    steps = np.linalg.norm(np.diff(log["velocity_command"].values, axis=0), axis=1)
    changed = np.diff(active) != 0
    metrics.add("step_at_guide_change", float(np.nanmax(steps[changed], initial=0.0)))
    forces = np.linalg.norm(log["guide_force"].values, axis=1)
    metrics.add("largest_guide_force", float(np.nanmax(forces)))
    metrics.add("guide_rest_distance", float(np.nanmin(log["guide_distance"].values[-1])))
    return metrics
