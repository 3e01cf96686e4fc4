"""Pushes on links, and the resulting motion of the elbow.

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

# signal of a station with pushed links
_PUSHES = "push_wrench"
# of a revolution, tolerance for a tool that rests after a full one
_SAME = 1e-4
PUSHED = 0.05  # share of a run's largest force, least force of a push
MILLI = 1e3


def is_redundant(station: Station) -> bool:
    """Return whether a station's robot has more joints than its task needs."""
    return station.robot.dimension > station.law.linearization.num_outputs


def has_elbow(station: Station) -> bool:
    """Return whether a station's arm has an elbow to be evaluated."""
    arm = isinstance(station.part, Arm)
    return arm and (_PUSHES in station.log.rows or is_redundant(station))


def elbow_motion(station: Station, joint_state: FloatArray) -> FloatArray:
    """Return positions of the elbow [m], shape (samples, 3).

    The elbow is the first pushed point; without pushes, for a redundant arm, the origin of the
    middle link's joint frame.

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
        first = station.diagram.GetSubsystemByName("link_pushes").points[0]
        point = (first.link, first.p_LQ)
    function = link_points_function(chain, [point]).map(len(joint_state))
    return np.array(function(joint_state[:, : chain.dimension].T)).T


def push_metrics(log: RunLog) -> Metrics:
    """Return the largest push on links and the elbow's displacement, if there are pushes.

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
    """Add pushes, three columns for each point, and actual and undisturbed elbow positions.

    Args:
        log: With ``eta``.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    labels = [f"{station.robot.names[station.robot.dimension // 2]} {axis}" for axis in "xyz"]
    if _PUSHES in raw:
        points = station.diagram.GetSubsystemByName("link_pushes").points
        labels = [f"{point.name} {axis}" for point in points for axis in "xyz"]
        log.add("push_force", push_forces(raw), labels=labels)
        log.add("push_point", raw["push_point"], labels=labels)
    if not has_elbow(station):
        return
    elbow = elbow_motion(station, raw["joint_state"])
    log.add("elbow", elbow, labels=labels[:3])
    undisturbed = None
    if _PUSHES in raw and station.task.revolution is not None:
        force, eta = log["push_force"].values, log["eta"].values[:, 0]
        undisturbed = previous_revolution(
            eta, elbow, np.any(force != 0.0, axis=1), station.task.revolution
        )
    if undisturbed is not None:
        log.add("elbow_undisturbed", undisturbed, labels=labels[:3])


def previous_revolution(
    eta: FloatArray, values: FloatArray, disturbed: NDArray[np.bool_], revolution: float
) -> FloatArray | None:
    """Return values at the same path position in the revolution before a disturbance.

    Args:
        eta: Arc length over several revolutions [m], shape (samples,).
        values: Shape (samples, dim).
        disturbed: Whether there is a disturbance, shape (samples,).
        revolution: Length of the path [m].

    Returns:
        Shape (samples, dim), equal to ``values`` before the disturbance; None without disturbance,
        or with one before the first full revolution.
    """
    if not disturbed.any():
        return None
    first = int(np.argmax(disturbed))
    if not eta[first] - eta[0] >= revolution * (1.0 - _SAME):
        return None
    along = np.maximum.accumulate(eta[:first])
    beyond = np.maximum(np.ceil((eta[first:] - along[-1]) / revolution - _SAME), 0.0)
    position = eta[first:] - revolution * beyond
    expected = [np.interp(position, along, column[:first]) for column in values.T]
    return np.vstack([values[:first], np.stack(expected, axis=1)])


def push_size(log: RunLog) -> FloatArray:
    """Return the magnitude of the largest force on a point of a link [N], shape (samples,)."""
    force = log["push_force"].values.reshape(len(log.time), -1, 3)
    return np.asarray(np.linalg.norm(force, axis=2).max(axis=1))


def elbow_shift(log: RunLog) -> FloatArray:
    """Return the displacement of the elbow from its undisturbed motion [m], shape (samples, 3).

    Without ``elbow_undisturbed``, from its position at the first push, zero before.
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
    """Return the largest distance of the elbow from its undisturbed motion [m].

    Without ``elbow_undisturbed``, from its position at the first push, during pushes.
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
    """Draw forces on links, and the displacement of the first pushed point.

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
    title = f"Displacement of {name}"
    panels[-1].set(ylabel="displacement in mm", title=title)
    for panel in panels:
        style.add_legend(panel)
    base = "its motion in the previous revolution" if compared else "its position at the first push"
    caption = f"Forces on links, and displacement of the pushed point of {name} from {base}."
    return style.Drawing("pushes", "Forces on links", caption, canvas)


FEATURE = Feature(
    signals=add_link_signals,
    metrics=lambda log, station, settings: push_metrics(log),
    figures={"pushes": draw_pushes},
)
