"""Motion of a recording, selected from the log of a run."""

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context

from diagrams.drawing.recorded import (
    RecordedDistance,
    RecordedHolder,
    RecordedMotion,
    RecordedObstacles,
    RecordedPushes,
)
from diagrams.holder_station import HOLDER
from diagrams.station import Station
from experiments.results.feature import Raw
from experiments.results.guidance_feature import region_times
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.controller.tasks.space_task import SpaceTask

# height of the tool's trace above a pressed surface, which would hide it [m]
_LIFT = 3e-3
# share of the samples within the colour scale, and least share of the largest distance
_LASTING, _LEAST_COLOR = 0.9, 0.1
# drawn position of unreported obstacles [m]
_OUT_OF_SIGHT = 1e3


def collect_motion(
    station: Station, root: Context, period: float, log: RunLog, start: float
) -> RecordedMotion:
    """Return the finite motion of a run at the frames of a recording.

    Args:
        station: The station that was simulated.
        root: Its context at the end.
        period: Time between frames [s].
        log: Its log from :func:`experiments.results.run_signals.collect_log`.
        start: Duration of the approach to the manifold [s]; its distance counts afterwards.
    """
    _, raw = station.log.read(root)
    finite = np.isfinite(np.hstack([raw["manifold_point"], raw["joint_state"]])).all(axis=1)
    usable = np.flatnonzero(finite)
    stride = max(1, round(period / station.controller.period))
    frames = usable[::stride]
    states = [station.part.coordinates.plant_state(x) for x in raw["joint_state"][frames]]
    half = station.part.coordinates.num_states // 2
    positions = np.array(states).reshape(len(frames), 2 * half)[:, :half]
    pushes = None
    if "push_force" in log:
        pushes = RecordedPushes(log["push_point"].values[frames], log["push_force"].values[frames])
    elif "led_point" in log:
        # the operator's force, at the commanded point
        hand = log["leader_hand"].values[frames]
        pushes = RecordedPushes(log["led_point"].values[frames], hand)
    points = raw["manifold_point"][frames, : station.task.projected_manifold.layout.size]
    return RecordedMotion(
        log.time[frames],
        positions,
        np.hstack([log["y_t"].values, log["R_e"].values])[frames],
        points,
        log["elbow"].values[frames] if "elbow" in log else None,
        pushes,
        _distance(log.time[frames], log["xi"].values[frames], start) if "xi" in log else None,
        log["wrench_ext"].values[frames, :3] if "wrench_ext" in log else None,
        _lifted(station, log["y_t"].values[frames], points),
        _region_times(station, log, frames),
        log["plate_pose"].values[frames] if "plate_pose" in log else None,
        _holder(station, raw, log, frames),
        _obstacles(station, log, frames),
    )


def _holder(
    station: Station, raw: Raw, log: RunLog, frames: NDArray[np.int_]
) -> RecordedHolder | None:
    """Return the motion of a moving workpiece and its robot, if any."""
    if station.turntable is not None:
        return RecordedHolder(None, log["workpiece_pose"].values[frames])
    if station.holder is None:
        return None
    coordinates = station.holder.part.coordinates
    states = [coordinates.plant_state(x) for x in raw[f"{HOLDER}joint_state"][frames]]
    half = coordinates.num_states // 2
    positions = np.array(states).reshape(len(frames), 2 * half)[:, :half]
    return RecordedHolder(positions, log["workpiece_pose"].values[frames])


def _obstacles(station: Station, log: RunLog, frames: NDArray[np.int_]) -> RecordedObstacles | None:
    """Return the motion of obstacles, if there are any."""
    crossing = station.crossing
    if crossing is None:
        return None
    shapes = [obstacle.shape for obstacle in crossing.moving]
    positions = np.nan_to_num(log["obstacle_position"].values[frames], nan=_OUT_OF_SIGHT)
    return RecordedObstacles(positions, shapes, crossing.watch.margin)


def _region_times(station: Station, log: RunLog, frames: NDArray[np.int_]) -> FloatArray | None:
    """Return the clock of moving regions, if there is one, shape (frames,)."""
    task = station.task
    return (
        region_times(log, task.command_dynamics.lag)[frames]
        if isinstance(task, SpaceTask)
        else None
    )


def _lifted(station: Station, y_t: FloatArray, points: FloatArray) -> FloatArray | None:
    """Return the tool's trace, lifted above a compliant workpiece, shape (frames, 3)."""
    workpiece, manifold = station.workpiece, station.task.projected_manifold
    if workpiece is None or len(points) == 0:
        return None
    normals = [workpiece.normal(manifold.axes(point).full()) for point in points]
    return None if normals[0] is None else y_t + _LIFT * np.array(normals)


def _distance(times: FloatArray, xi: FloatArray, start: float) -> RecordedDistance | None:
    """Return the signed distance from a surface; None for a path.

    Args:
        times: Times of the frames [s], shape (frames,).
        xi: Transversal coordinates [m], shape (frames, 1) of a surface.
        start: Time from which the distance counts [s].
    """
    if xi.shape[1] != 1:
        return None
    counting = np.abs(xi[times >= start, 0])
    if not counting.size or not counting.any():
        return None
    # lasting distances, such as a workpiece's shape, determine the scale, not a short approach
    largest = float(max(np.quantile(counting, _LASTING), _LEAST_COLOR * counting.max()))
    return RecordedDistance(xi[:, 0], largest)
