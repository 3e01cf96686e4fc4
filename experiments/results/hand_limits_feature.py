"""Forces of the robot's own limits on the guiding hand."""

import numpy as np

from diagrams.station import Station
from experiments.results.feature import Feature, Raw
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.fixtures.record import SLOT, GuidanceRecord
from pfsc_drake.control.fixtures.robot_limits import limit_kinds
from pfsc_drake.controller.tasks.space_task import SpaceTask
from reporting import style
from reporting.metrics import Metrics


def add_hand_limits(log: RunLog, station: Station, raw: Raw) -> None:
    """Add forces of the robot's own limits on the operator, for compliance or virtual fixtures.

    Args:
        log: Log of the run, which is extended.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    joints = station.robot.dimension
    if "guidance" in raw and isinstance(station.task, SpaceTask):
        regions = len(station.task.fixtures)
        near = raw["guidance"][:, GuidanceRecord(regions).fields["near"]]
        kinds, forces = limit_forces(near, regions, joints)
        log.add("limit_force", forces, labels=kinds)
    elif "limit_force" in raw:
        log.add("limit_force", raw["limit_force"], labels=list(dict.fromkeys(limit_kinds(joints))))


def limit_forces(near: FloatArray, regions: int, joints: int) -> tuple[list[str], FloatArray]:
    """Return the forces of the robot's own limits on the tool.

    Args:
        near: Slots as recorded, shape (samples, slots x 10).
        regions: Number of regions, after which the limits are numbered.
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


def limit_metrics(log: RunLog) -> Metrics:
    """Return duration and largest force of the robot's own limits on the operator.

    Args:
        log: Log of a run; without ``limit_force`` there are no such metrics.
    """
    metrics = Metrics()
    if "limit_force" not in log or log.time.size < 2:
        return metrics
    forces = np.nan_to_num(log["limit_force"].values)
    period = log.period
    active = np.count_nonzero(np.any(forces > 0.0, axis=1))
    metrics.add("time_at_limits", active * period)
    metrics.add("largest_limit_force", float(np.max(forces)))
    return metrics


def draw_limits(log: RunLog) -> style.Drawing | None:
    """Draw forces of joint limits, speed limits and singular postures on the tool."""
    forces = log["limit_force"]
    shown = np.flatnonzero(np.any(forces.values > 0.0, axis=0))
    if not shown.size:
        return None
    canvas, (force, speed) = style.make_panels(2)
    for k, column in enumerate(shown):
        colour = f"C{k}"
        label = _limit_label(forces.labels[column])
        force.plot(log.time, forces.values[:, column], color=colour, label=label)
    force.set(title="Forces of the robot's own limits on the operator", ylabel="force in N")
    velocity = np.gradient(log["y_t"].values, log.time, axis=0)
    speed.plot(log.time, np.linalg.norm(velocity, axis=1), color="C0")
    speed.set(title="Speed of the tool", ylabel="speed in m/s")
    style.add_legend(force)
    caption = (
        "At limits of joint position or speed, or near a singular posture, the operator feels a "
        "wall, as at a region."
    )
    return style.Drawing("limits", "Limits of the robot", caption, canvas)


def _limit_label(kind: str) -> str:
    """Return ``speed_3`` as ``axis 3, speed``."""
    name, _, axis = kind.partition("_")
    return f"axis {axis}, {name}" if axis else "singular posture"


FEATURE = Feature(
    signals=add_hand_limits,
    metrics=lambda log, station, settings: limit_metrics(log),
    figures={"limits": draw_limits},
)
