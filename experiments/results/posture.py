"""The posture of an arm beside its tool: its signals, and how well it is kept.

Signals used, as in the log: ``q_J``, ``v_J`` [samples, N] rad and rad/s, ``q_posture`` [samples, N]
rad, ``eta``, ``eta_dot`` [samples, 1] m and m/s.
"""

import math

import casadi as ca
import numpy as np

from diagrams.station import Station
from experiments.results.pushes import elbow_travel, finite_peak, push_size
from experiments.results.run_log import RunLog
from pfsc_drake import jets
from reporting.metrics import Metrics

REST = 0.1  # s, end of a run over which the joints' speeds are looked at
AT_REST = 1e-3  # m/s, below which the tool rests
AWAY = 1e-2  # m, from where on the tool has set off


def add_posture(log: RunLog, station: Station, raw: dict[str, np.ndarray]) -> None:
    """Log the posture reference, the coordinate that is kept, and what damping lets slip.

    Args:
        log: Where to add.
        station: The station.
        raw: Its logged signals, each (samples, size).
    """
    law, n = station.law, station.robot.dimension
    residual = raw["law"][:, law.layout.residual]
    if residual.shape[1]:
        labels = [coordinate.name for coordinate in law.linearization.manifold.coordinates]
        degree = law.linearization.relative_degree
        log.add("decoupling_residual", residual, f"SI/s^{degree}", labels)
    if "posture_reference" not in raw:
        return
    reference = raw["posture_reference"][:, :n]
    log.add("q_posture", reference)
    assert law.posture is not None
    if law.posture.coordinate is None:
        return
    swivel = np.zeros((2, len(reference)))
    if len(reference):
        q = ca.SX.sym("q", n)
        angle = law.posture.coordinate([jets.constant(q[i], 1) for i in range(n)]).coefficients[0]
        kept = ca.Function("coordinate", [q], [angle]).map(len(reference))
        both = (raw["joint_state"][:, :n], reference)
        swivel = np.array([np.unwrap(np.array(kept(x.T)).ravel()) for x in both])
    log.add("swivel", swivel.T, labels=["swivel", "swivel_p"])


def posture_metrics(log: RunLog, lap: float | None) -> Metrics:
    """Return the metrics of posture and pushes that a run has.

    Args:
        log: Log of a run.
        lap: Length of its path [m] if that is closed.
    """
    metrics, angle = Metrics(), log["q_J"].unit
    if "q_posture" in log:
        metrics.add("max_posture_error", max_posture_error(log), angle)
    if has_spare_joints(log):
        if lap is not None:
            metrics.add("posture_return", posture_return(log, lap), angle)
        metrics.add("final_joint_speed", final_joint_speed(log), log["v_J"].unit)
    if "push_force" in log:
        metrics.add("largest_push", finite_peak(push_size(log)))
        metrics.add("elbow_travel", elbow_travel(log))
    return metrics


def has_spare_joints(log: RunLog) -> bool:
    """Return whether a run's robot has more joints than the coordinates that it follows."""
    outputs = sum(log[name].dim for name in ("eta", "xi", "phi") if name in log)
    return 0 < outputs < log["q_J"].dim


def max_posture_error(log: RunLog) -> float:
    """Return the largest distance of a joint from the reference posture [rad]."""
    return finite_peak(log["q_J"].values - log["q_posture"].values)


def final_joint_speed(log: RunLog) -> float:
    """Return the largest speed of a joint over the end of a run [rad/s, of slides m/s].

    NaN if the tool does not rest there.
    """
    late = log.time >= log.time[-1] - REST
    rests = finite_peak(log["eta_dot"].values[late]) < AT_REST
    return finite_peak(log["v_J"].values[late]) if rests else math.nan


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
    return finite_peak(q[later] - np.stack(expected, axis=1))


def _setting_off(log: RunLog) -> int:
    """Return the last sample at rest before the tool goes away from where it starts."""
    eta, speed = log["eta"].values[:, 0], log["eta_dot"].values[:, 0]
    away = eta - eta[0] > AWAY
    gone = int(np.argmax(away)) if away.any() else len(eta)
    resting = np.flatnonzero(np.abs(speed[:gone]) < AT_REST)
    return int(resting[-1]) if resting.size else 0
