"""Metrics of plates that are mounted, each a pure function of a run's log.

Signals used, as in the log: ``seat_gap`` [samples, pins] m between a plate and the frame at its
pins, ``seat_offset`` [samples, 1] m, how far beside its seat it is, ``frame_force`` and
``magazine_force`` [samples, 3] N on the plates, ``held`` [samples, 1], share of the gripper's cups
that hold, ``hand_wrench`` [samples, 6] N and Nm of the operator, ``xi`` [samples, 2] m and ``phi``
[samples, 3] rad, how far the tool is off the path; from the first touch of the frame until the
plate is seated their means are ``insertion_deviation`` and ``insertion_rotation``.
"""

import math
from collections.abc import Collection

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
    """At which samples the plate is seated, [samples] bool.

    Args:
        log: With ``seat_gap`` and ``seat_offset``.
    """
    flush = np.all(np.abs(log["seat_gap"].values) <= SEATED, axis=1)
    return np.asarray(flush & (log["seat_offset"].values[:, 0] <= BESIDE))


def time_to_frame(log: RunLog) -> float:
    """First time at which the plate is at the frame, 2 cm from its seat.

    Args:
        log: With ``seat_gap`` and ``seat_offset``.

    Returns:
        s; NaN if none does.
    """
    near = np.all(np.abs(log["seat_gap"].values) <= REACHED, axis=1)
    return _first(log.time, near & (log["seat_offset"].values[:, 0] <= REACHED))


def time_to_contact(log: RunLog) -> float:
    """First time at which a plate touches the frame.

    Args:
        log: With ``frame_force``.

    Returns:
        s; NaN if none does.
    """
    return _first(log.time, _size(log, "frame_force") > TOUCHING)


def time_to_seat(log: RunLog) -> float:
    """First time at which the plate is seated.

    Args:
        log: With ``seat_gap`` and ``seat_offset``.

    Returns:
        s; NaN if it never is.
    """
    return _first(log.time, seated_samples(log))


def grip_time(log: RunLog) -> float:
    """Last time at which all cups have taken hold of a plate.

    Args:
        log: With ``held``.

    Returns:
        s; the start for a plate that is held from there on, NaN if none is.
    """
    held = log["held"].values[:, 0] >= 1.0
    taken = np.flatnonzero(held & ~np.append(False, held[:-1]))
    return float(log.time[taken[-1]]) if taken.size else math.nan


def release_time(log: RunLog) -> float:
    """First time at which no cup holds a plate that was held.

    Args:
        log: With ``held``.

    Returns:
        s; NaN if it is not let go.
    """
    held = log["held"].values[:, 0] > 0.0
    return _first(log.time, ~held & np.append(False, held[:-1]))


def mounting_metrics(log: RunLog) -> Metrics:
    """All metrics of this module that the log has signals for.

    Args:
        log: Of a path following run.
    """
    metrics = Metrics()
    if "seat_gap" not in log or log.time.size == 0:
        return metrics
    seated, at = seated_samples(log), time_to_seat(log)
    let_go = math.isfinite(release_time(log))
    metrics.add("mounted", float(seated[-1] and let_go), "1")
    metrics.add("final_seat_gap", float(np.abs(log["seat_gap"].values[-1]).max()), "m")
    metrics.add("grip_time", grip_time(log), "s")
    metrics.add("time_to_frame", time_to_frame(log), "s")
    metrics.add("time_to_contact", time_to_contact(log), "s")
    metrics.add("time_to_seat", at, "s")
    metrics.add("insertion_time", at - time_to_frame(log), "s")
    metrics.add("release_time", release_time(log), "s")
    metrics.add("peak_frame_force", float(_size(log, "frame_force").max()), "N")
    metrics.add("peak_magazine_force", float(_size(log, "magazine_force").max()), "N")
    inserting = (log.time >= time_to_contact(log)) & (log.time <= at)
    for name, signal, unit in (
        ("insertion_deviation", "xi", "m"),
        ("insertion_rotation", "phi", "rad"),
    ):
        sizes = _size(log, signal)[inserting]
        metrics.add(name, float(np.mean(sizes)) if sizes.size else math.nan, unit)
    if "hand_wrench" in log:
        force, torque = np.hsplit(log["hand_wrench"].values, 2)
        metrics.add("peak_operator_force", float(np.linalg.norm(force, axis=1).max()), "N")
        metrics.add("peak_operator_torque", float(np.linalg.norm(torque, axis=1).max()), "N m")
    return metrics


def mounting_metric_names(signals: Collection[str]) -> list[str]:
    """Return the names of the metrics that :func:`mounting_metrics` gives.

    Args:
        signals: Those that the log has.
    """
    if "seat_gap" not in signals:
        return []
    names = [
        "mounted", "final_seat_gap", "grip_time", "time_to_frame", "time_to_contact",
        "time_to_seat", "insertion_time", "release_time", "peak_frame_force", "peak_magazine_force",
        "insertion_deviation", "insertion_rotation",
    ]  # fmt: skip
    return names + ["peak_operator_force", "peak_operator_torque"] * ("hand_wrench" in signals)


def _size(log: RunLog, name: str) -> FloatArray:
    return np.asarray(np.linalg.norm(log[name].values, axis=1))


def _first(time: FloatArray, where: NDArray[np.bool_]) -> float:
    found = np.flatnonzero(where)
    return float(time[found[0]]) if found.size else math.nan


PLATE_SIGNALS = {
    "plate_pose", "seat_gap", "seat_offset", "frame_force", "magazine_force", "held",
}  # fmt: skip
_WRENCH = ["f_x", "f_y", "f_z", "mu_x", "mu_y", "mu_z"]


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
    log.add("plate_pose", poses, "m, 1", labels)
    gap, offset = seat_distances(station.mounting, poses[:, :12])
    log.add("seat_gap", gap, "m", [f"pin_{i + 1}" for i in range(gap.shape[1])])
    log.add("seat_offset", offset, "m")
    frame, magazine = np.hsplit(raw["plate_contact"], 2)
    log.add("frame_force", frame, "N", _WRENCH[:3])
    log.add("magazine_force", magazine, "N", _WRENCH[:3])
    log.add("held", raw["held"], "1")
    log.add("gripper_wrench", raw["gripper_wrench"], "N, Nm", _WRENCH)
    if "hand_wrench" in raw:
        log.add("hand_wrench", raw["hand_wrench"], "N, Nm", _WRENCH)
        phases = [phase.name.lower() for phase in MountingPhase]
        log.add("phase", raw["phase"].astype(int), "1", phases)


def plate_poses(state: FloatArray) -> FloatArray:
    """Return ``[p, R by rows]`` of K plates, world axes, shape (samples, 12 K).

    Args:
        state: Of their plant, see :func:`~pfsc_drake.physics.suction.cups_function`, shape
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
