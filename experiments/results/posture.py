"""Metrics of the motion that a run's tool does not show: posture, pushes, joints at the end.

Signals used, as in the log: ``q_J``, ``v_J`` [samples, N] rad and rad/s, ``q_posture`` [samples, N]
rad, ``eta``, ``eta_dot`` [samples, 1] m and m/s, ``push_force`` [samples, 3K] N, ``elbow`` and
perhaps ``elbow_undisturbed`` [samples, 3] m.
"""

import math
from collections.abc import Callable, Collection

import casadi as ca
import numpy as np

from diagrams.station import Station
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake import jets
from reporting.metrics import Metrics

REST = 0.1  # s, end of a run over which the joints' speeds are looked at
AT_REST = 1e-3  # m/s, below which the tool rests
AWAY = 1e-2  # m, from where on the tool has set off
PUSHED = 0.05  # share of a run's largest force, from which on it counts as a push


def has_spare_joints(log: RunLog) -> bool:
    """Whether a run's robot has more joints than the coordinates that it follows.

    Args:
        log: With ``q_J``.
    """
    outputs = sum(log[name].dim for name in ("eta", "xi", "phi") if name in log)
    return 0 < outputs < log["q_J"].dim


def max_posture_error(log: RunLog) -> float:
    """Largest magnitude of a joint's distance from the reference posture.

    Args:
        log: With ``q_J`` and ``q_posture``.

    Returns:
        rad.
    """
    return _largest(log["q_J"].values - log["q_posture"].values)


def push_size(log: RunLog) -> FloatArray:
    """Size of the largest force on a point of a link.

    Args:
        log: With ``push_force``.

    Returns:
        [samples] N.
    """
    force = log["push_force"].values.reshape(len(log.time), -1, 3)
    return np.asarray(np.linalg.norm(force, axis=2).max(axis=1))


def elbow_shift(log: RunLog) -> FloatArray:
    """How far the elbow is from where it would have been, or was when it was first pushed.

    Args:
        log: With ``push_force`` and ``elbow``; with ``elbow_undisturbed`` compared with that.

    Returns:
        [samples, 3] m; zero before it is pushed.
    """
    elbow = log["elbow"].values
    if "elbow_undisturbed" in log:
        return np.asarray(elbow - log["elbow_undisturbed"].values)
    pushed = push_size(log) > 0.0
    first = int(np.argmax(pushed))
    shift = elbow - elbow[first]
    shift[: first if pushed.any() else len(shift)] = 0.0
    return np.asarray(shift)


def elbow_travel(log: RunLog) -> float:
    """Largest distance of the elbow from where it would have been.

    Without such a motion to compare with: from where it was when it was first pushed, while it is
    pushed.

    Args:
        log: See :func:`elbow_shift`.

    Returns:
        m.
    """
    distance = np.linalg.norm(elbow_shift(log), axis=1)
    if "elbow_undisturbed" not in log:
        size = push_size(log)
        distance = distance[size >= PUSHED * size.max(initial=0.0)]
    return _largest(distance)


def final_joint_speed(log: RunLog) -> float:
    """Largest speed of a joint over the end of a run whose tool rests there.

    Args:
        log: With ``v_J`` and ``eta_dot``.

    Returns:
        rad/s (m/s of slides); NaN if the tool does not rest.
    """
    late = log.time >= log.time[-1] - REST
    rests = _largest(log["eta_dot"].values[late]) < AT_REST
    return _largest(log["v_J"].values[late]) if rests else math.nan


def posture_return(log: RunLog, lap: float) -> float:
    """Largest difference of a joint from where it was in the first lap at the same place.

    The first lap begins where the tool sets off, so that what it does beside the path before
    does not count.

    Args:
        log: With ``q_J``, ``eta`` and ``eta_dot`` of a closed path.
        lap: Length of the path [m].

    Returns:
        rad (m of slides); NaN if there is no second lap.
    """
    begin = _setting_off(log)
    eta, q = log["eta"].values[begin:, 0], log["q_J"].values[begin:]
    along = np.maximum.accumulate(eta)
    first = along <= eta[0] + lap
    later = eta > eta[0] + lap
    if not later.any():
        return math.nan
    place = eta[0] + np.mod(eta[later] - eta[0], lap)
    expected = [np.interp(place, along[first], column[first]) for column in q.T]
    return _largest(q[later] - np.stack(expected, axis=1))


def _setting_off(log: RunLog) -> int:
    """Return the last sample at rest before the tool goes away from where it starts."""
    eta, speed = log["eta"].values[:, 0], log["eta_dot"].values[:, 0]
    away = eta - eta[0] > AWAY
    gone = int(np.argmax(away)) if away.any() else len(eta)
    resting = np.flatnonzero(np.abs(speed[:gone]) < AT_REST)
    return int(resting[-1]) if resting.size else 0


def posture_metrics(log: RunLog, lap: float | None) -> Metrics:
    """All metrics of this module that a run has.

    Args:
        log: Of a path following run.
        lap: Length of its path [m] if that is closed.
    """
    angle, speed = log["q_J"].unit, log["v_J"].unit
    calculations: dict[str, tuple[Callable[[], float], str]] = {
        "max_posture_error": (lambda: max_posture_error(log), angle),
        "posture_return": (lambda: posture_return(log, lap or math.nan), angle),
        "final_joint_speed": (lambda: final_joint_speed(log), speed),
        "largest_push": (lambda: _largest(push_size(log)), "N"),
        "elbow_travel": (lambda: elbow_travel(log), "m"),
    }
    metrics = Metrics()
    for name in posture_metric_names(log.signals, has_spare_joints(log), lap is not None):
        calculate, unit = calculations[name]
        metrics.add(name, calculate(), unit)
    return metrics


def posture_metric_names(signals: Collection[str], redundant: bool, closed: bool) -> list[str]:
    """Return the names of the metrics that :func:`posture_metrics` gives.

    Args:
        signals: Of the log, among others ``q_posture`` and ``push_force`` if it has them.
        redundant: Whether the robot has more joints than the task needs.
        closed: Whether the path is.
    """
    names = ["max_posture_error"] if "q_posture" in signals else []
    names += ["posture_return"] if redundant and closed else []
    names += ["final_joint_speed"] if redundant else []
    return names + (["largest_push", "elbow_travel"] if "push_force" in signals else [])


def _largest(values: FloatArray) -> float:
    """Largest finite magnitude, NaN of none."""
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size else math.nan


def add_posture(log: RunLog, station: Station, raw: dict[str, np.ndarray], unit: str) -> None:
    """Log the posture reference, the coordinate that is kept, and what damping lets slip.

    Args:
        log: Where to add.
        station: The station.
        raw: Its logged signals, each (samples, size).
        unit: Of joint coordinates.
    """
    law, n = station.law, station.robot.dimension
    residual = raw["law"][:, law.layout.residual]
    if residual.size:
        labels = [coordinate.name for coordinate in law.linearization.manifold.coordinates]
        degree = law.linearization.relative_degree
        log.add("decoupling_residual", residual, f"SI/s^{degree}", labels)
    if "posture_reference" not in raw:
        return
    reference = raw["posture_reference"][:, :n]
    log.add("q_posture", reference, unit, [f"q_posture_{i + 1}" for i in range(n)])
    assert law.posture is not None
    if law.posture.coordinate is None:
        return
    q = ca.SX.sym("q", n)
    angle = law.posture.coordinate([jets.constant(q[i], 1) for i in range(n)]).coefficients[0]
    kept = ca.Function("coordinate", [q], [angle]).map(len(reference))
    swivel = [
        np.unwrap(np.array(kept(x.T)).ravel()) for x in (raw["joint_state"][:, :n], reference)
    ]
    log.add("swivel", np.array(swivel).T, "rad", ["swivel", "swivel_p"])


def posture_signals(station: Station) -> set[str]:
    """Return the signals that :func:`add_posture` logs for a station.

    Args:
        station: The station, simulated or not.
    """
    posture, residual = station.law.posture, station.law.layout.residual
    names = {"decoupling_residual"} if residual.stop > residual.start else set()
    if posture is not None:
        names |= {"q_posture"} if posture.coordinate is None else {"q_posture", "swivel"}
    return names
