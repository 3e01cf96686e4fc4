"""What happens to the links of a run's arm, where its elbow goes, and what its tool presses.

Signals used, as in the log: ``push_force`` [samples, 3K] N, ``elbow`` and perhaps
``elbow_undisturbed`` [samples, 3] m.
"""

import math

import numpy as np
from numpy.typing import NDArray

from diagrams.robots.arm import Arm
from diagrams.station import Station
from experiments.results.run_log import FloatArray, RunLog, peak
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


TOUCHING = 0.5  # N, from which on the tool counts as on the workpiece
SETTLING = 0.2  # s, from touch-down and full force on, until the force shall keep
_FULL = 0.999  # of the largest reference, from which on it counts as full
_SMALL = 0.1  # of the same; below it there is nothing to overshoot


def add_pressing(
    log: RunLog, station: Station, raw: dict[str, np.ndarray], points: np.ndarray
) -> None:
    """Add the force with which a workpiece presses along its normal, and what it is to be.

    Args:
        log: To add to.
        station: The station that was simulated.
        raw: What it logged.
        points: Points of the manifold, next to the tool, shape (samples, size).
    """
    if "press" in raw:
        log.add("press", raw["press"])
    workpiece, axes = station.workpiece, station.task.place.axes
    if workpiece is None or workpiece.normal(np.eye(3)) is None:
        return
    normals = np.array([workpiece.normal(axes(point).full()) for point in points]).reshape(-1, 3)
    log.add("normal_force", np.sum(raw["wrench_ext"][:, :3] * normals, axis=1, keepdims=True))


def press_metrics(log: RunLog) -> Metrics:
    """Return the metrics of pressing, none without ``normal_force``."""
    metrics = Metrics()
    if "normal_force" not in log or log.time.size == 0:
        return metrics
    metrics.add("peak_force", peak(log["normal_force"].values))
    if "press" in log:
        metrics.add("touch_down", touch_down(log))
        metrics.add("touch_down_overshoot", touch_down_overshoot(log))
        metrics.add("contact_losses", contact_losses(log))
        error = force_error(log)[held_samples(log)]
        metrics.add("max_force_error", peak(np.abs(error)))
        rms = float(np.sqrt(np.mean(error**2))) if error.size else math.nan
        metrics.add("rms_force_error", rms)
    return metrics


def touch_down(log: RunLog) -> float:
    """Return the first time at which the tool is on the workpiece [s]; NaN if it never is."""
    touching = np.flatnonzero(log["normal_force"].values[:, 0] > TOUCHING)
    return float(log.time[touching[0]]) if touching.size else math.nan


def held_samples(log: RunLog) -> NDArray[np.bool_]:
    """Return which samples are of the time in which the full force shall keep, (samples,)."""
    press = log["press"].values[:, 0]
    full = press >= _FULL * press.max()
    begin = log.time[int(np.argmax(full))]
    return np.asarray(full & (log.time >= max(begin, touch_down(log)) + SETTLING))


def force_error(log: RunLog) -> FloatArray:
    """Return the force on the workpiece less its reference [N], shape (samples,)."""
    return np.asarray((log["normal_force"].values - log["press"].values)[:, 0])


def touch_down_overshoot(log: RunLog) -> float:
    """Return the largest force above the reference of the moment, by it, until it shall keep.

    NaN if the tool never touches.
    """
    press, held = log["press"].values[:, 0], held_samples(log)
    if math.isnan(touch_down(log)):
        return math.nan
    until = log.time[int(np.argmax(held))] if held.any() else math.inf
    counted = (log.time >= touch_down(log)) & (log.time < until) & (press >= _SMALL * press.max())
    return max(0.0, peak((force_error(log) / np.where(counted, press, 1.0))[counted]))


def contact_losses(log: RunLog) -> float:
    """Return how often the tool leaves the workpiece while it is to press."""
    wanted = (log.time >= touch_down(log)) & (log["press"].values[:, 0] > TOUCHING)
    off = (log["normal_force"].values[:, 0] <= 0.0)[wanted]
    return float(np.count_nonzero(np.diff(off.astype(int)) > 0))
