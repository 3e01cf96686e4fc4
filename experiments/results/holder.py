"""Signals and metrics of a workpiece that moves: who carries it, and how the robot sees it."""

import numpy as np

from diagrams.holder_station import HOLDER
from diagrams.station import Station
from diagrams.turntable_station import TURNTABLE
from experiments.results.run_log import FloatArray, RunLog, peak
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.manifolds.carried import flange_motion_function
from pfsc_drake.control.manifolds.moving_frame import POSE_SIZE, frame_size
from pfsc_drake.geometry.rotation import placed_points
from reporting.metrics import Metrics


def workpiece_motion(station: Station, raw: dict[str, np.ndarray]) -> FloatArray | None:
    """Return the true motion of the workpiece, up to its velocity.

    Args:
        station: The station that was simulated.
        raw: What it logged.

    Returns:
        Derivatives 0..r of ``[p_WC, R_WC by rows]``, those from the second on zero, shape
        (samples, 12 (r + 1)); None of a station where nothing carries one.
    """
    holder, turntable = station.holder, station.turntable
    order = station.task.manifold.layout.order
    if turntable is not None:
        angles = raw[f"{TURNTABLE}motion"]
        motion = np.zeros((len(angles), frame_size(order)))
        if len(angles):
            mapped = turntable.motion.map(len(angles))
            motion[:, : 2 * POSE_SIZE] = np.array(mapped(angles.T)).T
        return motion
    if holder is None:
        return None
    state = raw[f"{HOLDER}joint_state"]
    motion = np.zeros((len(state), frame_size(order)))
    if len(state):
        moving = state[:, : 2 * holder.part.robot.dimension]
        function = flange_motion_function(holder.part.robot, 1).map(len(state))
        motion[:, : 2 * POSE_SIZE] = np.array(function(moving.T)).T
    return motion


def seen_poses(pose: FloatArray, frames: FloatArray) -> FloatArray:
    """Return poses in a frame that moves, ``[y_C, R_Ce by rows]``, shape (samples, 12).

    Args:
        pose: ``[y_t, R_e by rows]`` in the world, shape (samples, 12).
        frames: ``[p_WC, R_WC by rows, ..]``, shape (samples, 12 or more).
    """
    R_CW = np.swapaxes(frames[:, 3:POSE_SIZE].reshape(-1, 3, 3), 1, 2)
    y_C = np.einsum("kij,kj->ki", R_CW, pose[:, :3] - frames[:, :3])
    R_Ce = R_CW @ pose[:, 3:].reshape(-1, 3, 3)
    return np.hstack([y_C, R_Ce.reshape(-1, 9)])


def add_holder_signals(log: RunLog, station: Station, raw: dict[str, np.ndarray]) -> None:
    """Add where the workpiece is, and what the robot does that holds it.

    Args:
        log: To add to.
        station: The station that was simulated.
        raw: What it logged.
    """
    holder, frames = station.holder, workpiece_motion(station, raw)
    if frames is None:
        return
    if holder is None:
        log.add("workpiece_pose", frames[:, :POSE_SIZE])
        log.add("y_t_world", placed_points(log["y_t"].values, frames))
        angles, rates = np.hsplit(raw[f"{TURNTABLE}motion"], 2)
        log.add("turntable_angles", angles)
        log.add("turntable_rates", rates)
        log.add("frame_error", frame_error(raw[f"{TURNTABLE}frame_jet"], frames))
        return
    own = {name.removeprefix(HOLDER): x for name, x in raw.items() if name.startswith(HOLDER)}
    log.add("workpiece_pose", frames[:, :POSE_SIZE])
    log.add("y_t_world", placed_points(log["y_t"].values, frames))
    robot, layout = holder.part.robot, holder.law.layout
    limits = {
        "q_J": robot.gather("position_limits"),
        "v_J": robot.gather("velocity_limit"),
    }
    names = ("q_J", "v_J", "q_M", "v_M") if robot.elastic_joints.any() else ("q_J", "v_J")
    for name, values in zip(names, np.hsplit(own["joint_state"], 4), strict=False):
        log.add(f"{HOLDER}{name}", values, limits=limits.get(name))
    log.add(f"{HOLDER}tau_d", own["law"][:, layout.drive], limits=holder.law.limits)
    coordinates = holder.law.linearization.manifold.coordinates
    m, kinds = len(coordinates), [coordinate.kind.value for coordinate in coordinates]
    told, asked = own["law"][:, layout.manifold_state][:, :m], own["reference"][:, :m]
    for kind in dict.fromkeys(kinds):
        rows = [i for i, own_kind in enumerate(kinds) if own_kind == kind]
        log.add(f"{HOLDER}{kind}", told[:, rows])
        log.add(f"{HOLDER}{kind}_p", asked[:, rows])
    labels = [fault.name.lower() for fault in Fault]
    status = own["law"][:, layout.status]
    log.add(f"{HOLDER}fault", status[:, 0].astype(int), labels=labels)
    if "wrench_ext" in own:
        log.add(f"{HOLDER}wrench", own["wrench_ext"])
    log.add("frame_error", frame_error(own["frame_jet"], frames))


def frame_error(believed: FloatArray, true: FloatArray) -> FloatArray:
    """Return how far the workpiece is from where its motion is told [m, rad], (samples, 2).

    Args:
        believed: ``[p_WC, R_WC by rows, ..]`` as told, shape (samples, 12 or more).
        true: The same as it is.
    """
    off = np.linalg.norm(believed[:, :3] - true[:, :3], axis=1)
    R_1, R_2 = (x[:, 3:POSE_SIZE].reshape(-1, 3, 3) for x in (believed, true))
    # of a small turn, without loss of digits
    chord = np.linalg.norm((R_1 - R_2).reshape(-1, 9), axis=1) / np.sqrt(8.0)
    return np.column_stack([off, 2.0 * np.arcsin(np.minimum(chord, 1.0))])


def holder_metrics(log: RunLog, begin: float) -> Metrics:
    """Return the metrics of two robots, none without one that holds a workpiece.

    Args:
        log: Log of a run.
        begin: Time from which on deviations count [s].
    """
    metrics = Metrics()
    if "workpiece_pose" not in log or log.time.size < 2:
        return metrics
    counting = log.time >= begin
    frames, time = log["workpiece_pose"].values, log.time
    metrics.add("peak_workpiece_speed", peak(_speeds(time, frames[:, :3])))
    turning = 2.0 * np.arcsin(
        np.minimum(np.linalg.norm(np.diff(frames[:, 3:], axis=0), axis=1) / np.sqrt(8.0), 1.0)
    )
    metrics.add("peak_workpiece_turning", peak(turning / np.diff(time)))
    metrics.add("peak_tool_speed_world", peak(_speeds(time, log["y_t_world"].values)))
    held = f"{HOLDER}xi" in log
    if held:
        xi = np.linalg.norm(log[f"{HOLDER}xi"].values, axis=1)
        metrics.add("max_workpiece_deviation", peak(xi[counting]))
    error = log["frame_error"].values
    metrics.add("max_frame_error", peak(error[counting, 0]))
    metrics.add("max_frame_angle", peak(error[counting, 1]))
    if not held:
        return metrics
    for axis, torque in enumerate(np.abs(log[f"{HOLDER}tau_d"].values).max(axis=0), start=1):
        metrics.add(f"peak_holder_torque_{axis}", float(torque), log[f"{HOLDER}tau_d"].unit)
    return metrics


def _speeds(time: FloatArray, points: FloatArray) -> FloatArray:
    """Return the speed of a point from sample to sample [m/s], shape (samples - 1,)."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.asarray(steps / np.diff(time))
