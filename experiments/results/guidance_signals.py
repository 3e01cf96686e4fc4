"""Signals of a tool that is led by hand within virtual fixtures."""

import numpy as np

from diagrams.station import Station
from diagrams.tasks.space_guidance import SpaceTask
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.fixtures.program import SLOTS
from pfsc_drake.control.fixtures.record import SLOT, GuidanceRecord, Mode
from pfsc_drake.control.fixtures.robot_limits import limit_kinds

# of the record: log name, unit, labels
_SINGLE = {
    "velocity": ("velocity_command", "m/s", ["v_x", "v_y", "v_z"]),
    "point": ("rest_point", "m", ["x", "y", "z"]),
    "force": ("guiding_force", "N", ["f_x", "f_y", "f_z"]),
    "tank": ("tank", "J", ["x"]),
    "clock": ("region_clock", "s", ["s"]),
    "rate": ("region_rate", "1", ["rho"]),
    "spring": ("spring_energy", "J", ["V"]),
    "damping": ("free_damping", "N s/m", ["d"]),
    "limit": ("speed_limit", "m/s", ["v"]),
    "squeezed": ("squeezed", "1", ["squeezed"]),
}
_SLOT_UNITS = "1, m, 1, 1, 1, m/s, m/s, N, N/m, m"


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
    log.add("mode", modes, "1", [mode.name.lower() for mode in Mode])
    for name, (signal, unit, labels) in _SINGLE.items():
        log.add(signal, rows[name], unit, labels)
    names = [fixture.name for fixture in task.fixtures]
    slots = [f"{key}_{slot}" for slot in range(SLOTS) for key in SLOT]
    log.add("near_regions", rows["near"], _SLOT_UNITS, slots)
    for name in ("labels", "evaluated", "on"):
        log.add(f"region_{name}", np.nan_to_num(rows[name]).astype(int), "1", names)
    distances = task.distances(y_t, region_times(log, task.guided.lead.lag))
    distances[rows["on"] == 0.0] = np.nan  # a region that is switched off is nowhere
    log.add("region_distance", distances, "m", names)
    kinds, forces = limit_forces(rows["near"], len(names), station.robot.dimension)
    log.add("limit_force", forces, "N", kinds)


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
    slots = near.reshape(len(near), -1, len(SLOT))
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
