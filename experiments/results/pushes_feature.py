"""Pushes on links, and how far they move the elbow.

Signals used, as in the log: ``push_force`` [samples, 3K] N, ``elbow`` and perhaps
``elbow_undisturbed`` [samples, 3] m, ``eta`` [samples, 1] m.
"""

import math

import numpy as np
from numpy.typing import NDArray

from diagrams.robots.arm import Arm
from diagrams.station import Station
from experiments.results.feature import Feature, Raw
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.physics.link_forces import link_points_function
from reporting import style
from reporting.metrics import Metrics

# what stands in a station's log where links are pushed
_PUSHES = "push_wrench"
# of a lap, by which a tool that rests after a lap may miss its end
_SAME = 1e-4
PUSHED = 0.05  # share of a run's largest force, from which on it counts as a push
MILLI = 1e3


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


def push_metrics(log: RunLog) -> Metrics:
    """Return the size of pushes on links and how far they moved the elbow, if there were any.

    Args:
        log: Log of a run.
    """
    metrics = Metrics()
    if "push_force" in log:
        metrics.add("largest_push", finite_peak(push_size(log)))
        metrics.add("elbow_travel", elbow_travel(log))
    return metrics


def push_forces(raw: Raw) -> FloatArray:
    """Return the forces on K points of links, world axes [N], shape (samples, 3K).

    Args:
        raw: Logged signals of a station, with ``push_wrench``.
    """
    wrenches = raw[_PUSHES]
    force = wrenches.reshape(len(wrenches), wrenches.shape[1] // 6, 2, 3)[:, :, 0]
    return force.reshape(len(wrenches), wrenches.shape[1] // 2)


def add_link_signals(log: RunLog, station: Station, raw: Raw) -> None:
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


def draw_pushes(log: RunLog) -> style.Drawing | None:
    """Forces on links, and how far the first pushed point is from its undisturbed motion.

    Args:
        log: With ``push_force`` and ``elbow``, perhaps with ``elbow_undisturbed``.
    """
    signal = log["push_force"]
    if style.largest(signal.values) == 0.0:
        return None
    count = signal.dim // 3
    canvas, panels = style.make_panels(count + 1, height=2.4)
    for k, panel in enumerate(panels[:count]):
        part, names = signal.values[:, 3 * k : 3 * k + 3], signal.labels[3 * k : 3 * k + 3]
        panel.axhline(0.0, color=style.REFERENCE, linewidth=0.8)
        style.draw_components(panel, log.time, part, [f"$f_{name[-1]}$" for name in names])
        panel.set(ylabel="force in N", title=f"Force on {names[0].rsplit(' ', 1)[0]}, world axes")
    shift = MILLI * elbow_shift(log)
    panels[-1].axhline(0.0, color=style.REFERENCE, linewidth=0.8)
    style.draw_components(panels[-1], log.time, shift, ["$x$", "$y$", "$z$"])
    distance = np.linalg.norm(shift, axis=1)
    panels[-1].plot(log.time, distance, "--", color=style.INK, linewidth=1.1, label="distance")
    compared, name = "elbow_undisturbed" in log, log["elbow"].labels[0].rsplit(" ", 1)[0]
    title = f"{name} against the lap before" if compared else f"Way of {name} since the first push"
    panels[-1].set(ylabel="way in mm", title=title)
    for panel in panels:
        style.place_legend(panel)
    what = "its motion in the lap before" if compared else "where it was when the push began"
    caption = f"Forces on links, and how far {name} is from {what}, at the point that is pushed."
    return style.Drawing("pushes", "Forces on links", caption, canvas)


FEATURE = Feature(
    signals=add_link_signals,
    metrics=lambda log, station, settings: push_metrics(log),
    figures={"pushes": draw_pushes},
)
