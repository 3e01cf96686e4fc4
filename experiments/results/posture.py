"""What happens to an arm beside its tool: pushes on its links, its elbow, its posture.

Signals used, as in the log: ``push_force`` [samples, 3K] N, ``elbow`` and perhaps
``elbow_undisturbed`` [samples, 3] m, ``q_J``, ``v_J`` [samples, N] rad and rad/s, ``q_posture``
[samples, N] rad, ``eta``, ``eta_dot`` [samples, 1] m and m/s.
"""

import math

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from diagrams.robots.arm import Arm
from diagrams.station import Station
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake import jets
from pfsc_drake.physics.link_forces import link_points_function
from reporting.metrics import Metrics

# what stands in a station's log where links are pushed
_PUSHES = "push_wrench"
# of a lap, by which a tool that rests after a lap may miss its end
_SAME = 1e-4
PUSHED = 0.05  # share of a run's largest force, from which on it counts as a push


def is_redundant(station: Station) -> bool:
    """Return whether a station's robot has more joints than its task needs."""
    return station.robot.dimension > station.law.linearization.num_outputs


def has_elbow(station: Station) -> bool:
    """Return whether a point of a station's arm is worth a look beside its tool."""
    arm = isinstance(station.part, Arm)
    return arm and (_PUSHES in station.log.rows or is_redundant(station))


def elbow_motion(station: Station, joint_state: FloatArray) -> FloatArray:
    """Return where the elbow is [m], shape (samples, 3).

    It is the point that is pushed, the first of several; else, of a redundant arm, the origin of
    the middle link's joint frame.

    Args:
        station: The station, with an elbow, see :func:`has_elbow`.
        joint_state: ``[q_J, v_J, q_M, v_M]``, shape (samples, 4N).
    """
    assert isinstance(station.part, Arm)  # see has_elbow
    if len(joint_state) == 0:
        return np.zeros((0, 3))
    chain = station.part.robot
    point = (chain.dimension // 2, np.zeros(3))
    if _PUSHES in station.log.rows:
        first = station.diagram.GetSubsystemByName("link_pushes").places[0]
        point = (first.link, first.p_LQ)
    function = link_points_function(chain, [point]).map(len(joint_state))
    return np.array(function(joint_state[:, : chain.dimension].T)).T


def push_forces(raw: dict[str, FloatArray]) -> FloatArray:
    """Return the forces on K points of links, world axes [N], shape (samples, 3K).

    Args:
        raw: Logged signals of a station, with ``push_wrench``.
    """
    wrenches = raw[_PUSHES]
    force = wrenches.reshape(len(wrenches), wrenches.shape[1] // 6, 2, 3)[:, :, 0]
    return force.reshape(len(wrenches), wrenches.shape[1] // 2)


def add_link_signals(log: RunLog, station: Station, raw: dict[str, FloatArray]) -> None:
    """Add pushes, three columns for each point, and where the elbow is and would have been.

    Args:
        log: With ``eta``.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    labels = [f"{station.robot.names[station.robot.dimension // 2]} {axis}" for axis in "xyz"]
    if _PUSHES in raw:
        places = station.diagram.GetSubsystemByName("link_pushes").places
        labels = [f"{place.name} {axis}" for place in places for axis in "xyz"]
        log.add("push_force", push_forces(raw), labels=labels)
        log.add("push_point", raw["push_point"], labels=labels)
    if not has_elbow(station):
        return
    elbow = elbow_motion(station, raw["joint_state"])
    log.add("elbow", elbow, labels=labels[:3])
    undisturbed = None
    if _PUSHES in raw and station.task.lap is not None:
        force, eta = log["push_force"].values, log["eta"].values[:, 0]
        undisturbed = lap_before(eta, elbow, np.any(force != 0.0, axis=1), station.task.lap)
    if undisturbed is not None:
        log.add("elbow_undisturbed", undisturbed, labels=labels[:3])


def lap_before(
    eta: FloatArray, values: FloatArray, disturbed: NDArray[np.bool_], lap: float
) -> FloatArray | None:
    """Return what was at the same place of a closed path in the lap before a disturbance.

    Args:
        eta: Arc length, laps counted [m], shape (samples,).
        values: Shape (samples, dim).
        disturbed: Whether something disturbs, shape (samples,).
        lap: Length of the path [m].

    Returns:
        Shape (samples, dim), the values themselves before the disturbance; None where it never
        comes, or before a whole lap forwards is driven.
    """
    if not disturbed.any():
        return None
    first = int(np.argmax(disturbed))
    if not eta[first] - eta[0] >= lap * (1.0 - _SAME):
        return None
    along = np.maximum.accumulate(eta[:first])
    beyond = np.maximum(np.ceil((eta[first:] - along[-1]) / lap - _SAME), 0.0)
    place = eta[first:] - lap * beyond
    expected = [np.interp(place, along, column[:first]) for column in values.T]
    return np.vstack([values[:first], np.stack(expected, axis=1)])


def push_size(log: RunLog) -> FloatArray:
    """Return the size of the largest force on a point of a link [N], shape (samples,)."""
    force = log["push_force"].values.reshape(len(log.time), -1, 3)
    return np.asarray(np.linalg.norm(force, axis=2).max(axis=1))


def elbow_shift(log: RunLog) -> FloatArray:
    """Return how far the elbow is from where it would have been [m], shape (samples, 3).

    Without ``elbow_undisturbed``, from where it was when it was first pushed, zero before.
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
    """Return the largest distance of the elbow from where it would have been [m].

    Without ``elbow_undisturbed``, from where it was when it was first pushed, while it is pushed.
    """
    distance = np.linalg.norm(elbow_shift(log), axis=1)
    if "elbow_undisturbed" not in log:
        size = push_size(log)
        distance = distance[size >= PUSHED * size.max(initial=0.0)]
    return finite_peak(distance)


def finite_peak(values: FloatArray) -> float:
    """Return the largest finite magnitude, NaN of none."""
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size else math.nan


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
    rests = finite_peak(_progress_rate(log)[late]) < AT_REST
    return finite_peak(log["v_J"].values[late]) if rests else math.nan


def _progress_rate(log: RunLog) -> np.ndarray:
    """Return the rate of progress [m/s]; velocity servos leave it to be told from progress."""
    if "eta_dot" in log:
        return log["eta_dot"].values
    eta = log["eta"].values
    return np.gradient(eta, log.time, axis=0) if len(eta) > 1 else np.zeros_like(eta)


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
    eta, speed = log["eta"].values[:, 0], _progress_rate(log)[:, 0]
    away = eta - eta[0] > AWAY
    gone = int(np.argmax(away)) if away.any() else len(eta)
    resting = np.flatnonzero(np.abs(speed[:gone]) < AT_REST)
    return int(resting[-1]) if resting.size else 0
