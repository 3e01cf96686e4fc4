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

from experiments.results.run_log import FloatArray, RunLog
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
