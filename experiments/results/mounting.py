"""Plates that are mounted: their signals, and metrics that are pure functions of a log.

Signals used, as in the log: ``seat_gap`` [samples, pins] m between a plate and the frame at its
pins, ``seat_offset`` [samples, 1] m, how far beside its seat it is, ``frame_force`` and
``magazine_force`` [samples, 3] N on the plates, ``held`` [samples, 1], share of the gripper's cups
that hold, ``hand_wrench`` [samples, 6] N and Nm of the operator, ``xi`` [samples, 2] m and ``phi``
[samples, 3] rad, how far the tool is off the path; from the first touch of the frame until the
plate is seated their means are ``insertion_deviation`` and ``insertion_rotation``.
"""

import math

import numpy as np
from numpy.typing import NDArray

from diagrams.station import Station
from diagrams.surroundings.mounting import Mounting
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.geometry import quaternion_to_matrix
from pfsc_drake.physics.mounting_hand import MountingPhase
from reporting.metrics import Metrics

SEATED = 2e-4  # m, gap at every pin up to which a plate is seated
BESIDE = 2e-3  # m, beside its seat at most, for a gap to be one
REACHED = 0.02  # m, gap and distance beside its seat at which a plate is at the frame
TOUCHING = 0.5  # N, from which on a plate counts as touching


def seated_samples(log: RunLog) -> NDArray[np.bool_]:
    """Return at which samples the plate is seated, shape (samples,)."""
    flush = np.all(np.abs(log["seat_gap"].values) <= SEATED, axis=1)
    return np.asarray(flush & (log["seat_offset"].values[:, 0] <= BESIDE))


def time_to_frame(log: RunLog) -> float:
    """Return the first time at which the plate is 2 cm from its seat [s]; NaN if it never is."""
    near = np.all(np.abs(log["seat_gap"].values) <= REACHED, axis=1)
    return _first(log.time, near & (log["seat_offset"].values[:, 0] <= REACHED))


def time_to_contact(log: RunLog) -> float:
    """Return the first time at which a plate touches the frame [s]; NaN if none does."""
    return _first(log.time, _size(log, "frame_force") > TOUCHING)


def time_to_seat(log: RunLog) -> float:
    """Return the first time at which the plate is seated [s]; NaN if it never is."""
    return _first(log.time, seated_samples(log))


def grip_time(log: RunLog) -> float:
    """Return the last time at which all cups have taken hold of a plate [s].

    It is the start for a plate that is held from there on, NaN if none is.
    """
    held = log["held"].values[:, 0] >= 1.0
    taken = np.flatnonzero(held & ~np.append(False, held[:-1]))
    return float(log.time[taken[-1]]) if taken.size else math.nan


def release_time(log: RunLog) -> float:
    """Return the first time at which no cup holds a plate that was held [s]; NaN without."""
    held = log["held"].values[:, 0] > 0.0
    return _first(log.time, ~held & np.append(False, held[:-1]))


def mounting_metrics(log: RunLog) -> Metrics:
    """Return the metrics of mounting, none without ``seat_gap``."""
    metrics = Metrics()
    if "seat_gap" not in log or log.time.size == 0:
        return metrics
    seated, at = seated_samples(log), time_to_seat(log)
    let_go = math.isfinite(release_time(log))
    metrics.add("mounted", float(seated[-1] and let_go))
    metrics.add("final_seat_gap", float(np.abs(log["seat_gap"].values[-1]).max()))
    metrics.add("grip_time", grip_time(log))
    metrics.add("time_to_frame", time_to_frame(log))
    metrics.add("time_to_contact", time_to_contact(log))
    metrics.add("time_to_seat", at)
    metrics.add("insertion_time", at - time_to_frame(log))
    metrics.add("release_time", release_time(log))
    metrics.add("peak_frame_force", float(_size(log, "frame_force").max()))
    metrics.add("peak_magazine_force", float(_size(log, "magazine_force").max()))
    inserting = (log.time >= time_to_contact(log)) & (log.time <= at)
    for name, signal in (("insertion_deviation", "xi"), ("insertion_rotation", "phi")):
        sizes = _size(log, signal)[inserting]
        metrics.add(name, float(np.mean(sizes)) if sizes.size else math.nan)
    if "hand_wrench" in log:
        force, torque = np.hsplit(log["hand_wrench"].values, 2)
        metrics.add("peak_operator_force", float(np.linalg.norm(force, axis=1).max()))
        metrics.add("peak_operator_torque", float(np.linalg.norm(torque, axis=1).max()))
    return metrics


def _size(log: RunLog, name: str) -> FloatArray:
    return np.asarray(np.linalg.norm(log[name].values, axis=1))


def _first(time: FloatArray, where: NDArray[np.bool_]) -> float:
    found = np.flatnonzero(where)
    return float(time[found[0]]) if found.size else math.nan


def add_mounting_signals(log: RunLog, station: Station, raw: dict[str, np.ndarray]) -> None:
    """Add where plates are, what they touch, and what the operator does.

    Args:
        log: To add to.
        station: The station that was simulated.
        raw: What it logged.
    """
    if station.mounting is None:
        return
    poses = plate_poses(raw["plate_state"])
    names = [*"xyz", *(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))]
    labels = [f"plate_{k + 1}_{name}" for k in range(poses.shape[1] // 12) for name in names]
    log.add("plate_pose", poses, labels=labels)
    gap, offset = seat_distances(station.mounting, poses[:, :12])
    log.add("seat_gap", gap)
    log.add("seat_offset", offset)
    frame, magazine = np.hsplit(raw["plate_contact"], 2)
    log.add("frame_force", frame)
    log.add("magazine_force", magazine)
    log.add("held", raw["held"])
    log.add("gripper_wrench", raw["gripper_wrench"])
    if "hand_wrench" in raw:
        log.add("hand_wrench", raw["hand_wrench"])
        phases = [phase.name.lower() for phase in MountingPhase]
        log.add("phase", raw["phase"].astype(int), labels=phases)


def plate_poses(state: FloatArray) -> FloatArray:
    """Return ``[p, R by rows]`` of K plates, world axes, shape (samples, 12 K).

    Args:
        state: State of their plant, see :func:`~pfsc_drake.physics.suction.cups_function`, shape
            (samples, 13 K).
    """
    samples, count = len(state), state.shape[1] // 13
    q = state[:, : 7 * count].reshape(samples, count, 7)
    R = quaternion_to_matrix(q[..., :4]).reshape(samples, count, 9)
    return np.concatenate([q[..., 4:], R], axis=2).reshape(samples, 12 * count)


def seat_distances(mounting: Mounting, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far a plate is from its seat.

    Args:
        mounting: Where the seat is.
        pose: ``[p, R by rows]`` of the plate, shape (samples, 12).

    Returns:
        The gap between underside and frame at each pin, negative for what is below its surface,
        shape (samples, pins), and the distance beside the seat, shape (samples, 1) [m].
    """
    pins, seat = np.array(mounting.parameters.pins.positions), mounting.X_WF
    roots = np.column_stack([pins, np.zeros(len(pins))])
    R = pose[:, 3:].reshape(-1, 3, 3)
    points = pose[:, np.newaxis, :3] + np.einsum("tij,nj->tni", R, roots)
    # the face that is gripped is as far from its seat as the underside
    in_frame = (points - seat.translation()) @ seat.rotation().matrix()
    beside = np.linalg.norm(in_frame[:, :, :2] - pins, axis=2).max(axis=1, keepdims=True)
    return -in_frame[:, :, 2], beside
