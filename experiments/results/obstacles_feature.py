"""Obstacles that cross a path: distance from the arm, speed scaling, time lost.

Signals used, as in the log: ``obstacle_position`` [samples, 3K] m, ``obstacle_distance``
[samples, K] m, ``arm_speed`` [samples, 1] m/s, ``time_lost`` [samples, 1] s.
"""

import numpy as np

from diagrams.scenario import Scenario, Target
from diagrams.scenario.obstacles import CrossingParameters
from diagrams.station import Station
from experiments.results.feature import Feature, Raw
from experiments.results.run_log import FloatArray, RunLog, peak
from pfsc_drake.control.obstacles.clearance import least_distances
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.outline import arm_outline, outline_points
from reporting import style
from reporting.metrics import Metrics

_PASSES, _WAITS = "#DCFCE7", "#FEF3C7"
_RESTING = 0.05  # speed scaling below which the reference waits
_FAR = 2.0  # m, larger distances are not shown


def add_obstacles(log: RunLog, station: Station, raw: Raw) -> None:
    """Add positions of obstacles, their actual distance from the arm, and speed scaling.

    Args:
        log: Log of the run, which is extended; nothing without obstacles.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    crossing = station.crossing
    if crossing is None:
        return
    count = len(crossing.moving)
    labels = [f"obstacle_{k + 1} {axis}" for k in range(count) for axis in "xyz"]
    for name, source in (("position", "obstacles"), ("measured", "obstacles_measured")):
        log.add(f"obstacle_{name}", _positions(raw[source], count), labels=labels)
    chain, radius = station.part.robot, crossing.watch.arm_radius
    assert isinstance(chain, SerialChain)  # else nothing waits
    q_J = raw["joint_state"][:, : chain.dimension]
    outline = arm_outline(chain, radius)
    arm = np.zeros((0, 3 * len(outline.points)))
    if len(q_J):
        arm = outline_points(chain, outline).map(len(q_J))(q_J.T).full().T
    shapes = [obstacle.shape for obstacle in crossing.moving]
    log.add("arm_speed", _fastest(arm, log.time))
    distance = least_distances(arm, log["obstacle_position"].values, shapes, radius)
    margin = np.array([[crossing.watch.margin, np.inf]])
    names = [f"obstacle_{k + 1}" for k in range(count)]
    log.add("obstacle_distance", distance, labels=names, limits=margin)
    own_time, scaling = raw["clock"][:, 0], raw["clock"][:, 1]
    end = station.reference_duration
    log.add("waiting_pace", np.where(own_time < end, scaling, 0.0))
    log.add("permitted_pace", raw["watch"][:, 1])
    log.add("passing", raw["watch"][:, 2])
    late = log.time - own_time
    # no time is lost after the end of the motion
    running = np.flatnonzero(own_time < end)
    if running.size:
        late[running[-1] + 1 :] = late[running[-1]]
    log.add("time_lost", late)


def _fastest(arm: FloatArray, time: FloatArray) -> FloatArray:
    """Return the largest speed of the points of an arm's outline [m/s], shape (samples,)."""
    if len(time) < 2:
        return np.zeros(len(time))
    velocity = np.gradient(arm, time, axis=0).reshape(len(time), -1, 3)
    return np.asarray(np.linalg.norm(velocity, axis=2).max(axis=1))


def _positions(states: FloatArray, count: int) -> FloatArray:
    return states.reshape(len(states), count, 6)[:, :, :3].reshape(len(states), 3 * count)


def obstacle_metrics(log: RunLog, crossing: CrossingParameters | None) -> Metrics:
    """Return the least distances of obstacles, and the time lost by waiting, if there are any.

    Args:
        log: Log of a run.
        crossing: The obstacles.
    """
    metrics = Metrics()
    if crossing is None or "obstacle_distance" not in log or not log.time.size:
        return metrics
    least = log["obstacle_distance"].values.min(axis=1)
    # obstacles of a driven robot may never have been reported
    known = np.isfinite(least)
    metrics.add("least_distance", float(least[known].min()) if known.any() else np.nan)
    # any motion counts: along the path, to it, beside it, or of the elbow
    moving = known & (log["arm_speed"].values[:, 0] > crossing.watch.resting_speed)
    metrics.add(
        "least_distance_while_moving", float(least[moving].min()) if moving.any() else np.nan
    )
    metrics.add("waited_time", float(log["time_lost"].values[-1, 0]))
    position = log["obstacle_position"].values.reshape(len(log.time), -1, 3)
    speed = np.linalg.norm(np.gradient(position, log.time, axis=0), axis=2)
    metrics.add("largest_obstacle_speed", peak(speed[np.isfinite(speed)]))
    return metrics


def draw_obstacles(log: RunLog) -> style.Drawing:
    """Draw distance between arm and obstacles, speed scaling, and time lost.

    Args:
        log: With ``obstacle_distance``, ``waiting_pace``, ``permitted_pace``, ``time_lost``.
    """
    canvas, (distance, scaling, lost) = style.make_panels(3, height=2.4)
    signal = log["obstacle_distance"]
    for k, column in enumerate(signal.values.T):
        name = signal.labels[k].replace("_", " ")
        distance.plot(log.time, column, color=f"C{k}", label=name)
    if signal.limits is not None:
        margin = float(signal.limits[0, 0])
        distance.axhline(margin, linestyle="--", color=style.INK, linewidth=1.1, label="margin")
    top = min(_FAR, 1.05 * float(np.nanmax(signal.values, initial=0.1)))
    distance.set(ylabel="distance in m", title="Arm and obstacles", ylim=(0.0, top))
    going = log["waiting_pace"].values[:, 0]
    permitted = log["permitted_pace"].values[:, 0]
    scaling.plot(log.time, going, color="C0", label="speed scaling")
    scaling.plot(log.time, permitted, "--", color=style.REFERENCE, label="safe for any motion")
    scaling.set(ylabel="speed / planned speed", title="Speed scaling of the reference")
    scaling.set_ylim(min(-0.02, 1.05 * float(going.min(initial=0.0))), 1.05)
    lost.plot(log.time, log["time_lost"].values[:, 0], color="C1")
    lost.set(ylabel="time in s", title="Time lost", ylim=(0.0, None))
    running = np.flatnonzero(going)
    waits = np.abs(going) < _RESTING
    if running.size:
        waits[: running[0]] = waits[running[-1] :] = False
    style.shade([distance, scaling, lost], log.time, waits, "waits", _WAITS)
    for panel in (distance, scaling):
        style.add_legend(panel)
    caption = (
        "Actual distance between the surfaces of arm and obstacles; speed scaling of the "
        "reference, "
        "and the largest one that permits a stop in time; delay of the reference."
    )
    return style.Drawing("obstacles", "Obstacles", caption, canvas)


def _requirements(settings: Scenario) -> dict[str, Target]:
    """Require the margin of the watch while the arm moves."""
    if settings.obstacles is None:
        return {}
    margin = settings.obstacles.watch.margin
    return {"least_distance_while_moving": Target(f">= {margin:g}", "obstacles.watch.margin")}


FEATURE = Feature(
    signals=add_obstacles,
    metrics=lambda log, station, settings: obstacle_metrics(log, settings.obstacles),
    requirements=_requirements,
    always=("least_distance_while_moving",),
    figures={"obstacles": draw_obstacles},
)
