"""Waypoints received while the tool moves."""

import math

import numpy as np

from diagrams.scenario import Target
from diagrams.station import Station
from experiments.results.feature import Feature, Raw
from experiments.results.run_log import RunLog
from pfsc_drake.control.streams.messages import StreamStatus
from reporting import style
from reporting.metrics import Metrics

_GOES = 1e-3  # m/s, least speed of a moving reference
# m, allowed travel of the tool past the end of the known path: it follows its reference
_PAST = 1e-3
_ARRIVED = 1e-3  # m, distance from the end
_MM = 1e3


def add_stream(log: RunLog, station: Station, raw: Raw) -> None:
    """Add status and progress of a waypoint stream.

    Args:
        log: Log of the run; unchanged if the path is known beforehand.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    if "stream" not in raw:
        return
    status, taken, left, speed = raw["stream"].T[:, :, None]
    names = [status.name.lower() for status in StreamStatus]
    log.add("stream_status", status.astype(int), labels=names)
    log.add("way_points", taken)
    log.add("way_left", left)
    log.add("bend_speed", speed)


def stream_metrics(log: RunLog) -> Metrics:
    """Return the metrics of a streamed path; none of another.

    ``past_known_way`` is the largest actual travel of the tool beyond the end of the path known
    from received waypoints; negative if it always stayed before it.

    Args:
        log: Log of a run.
    """
    metrics = Metrics()
    if "way_left" not in log or "eta_p" not in log or log.time.size == 0:
        return metrics
    eta, eta_p = log["eta"].values[:, 0], log["eta_p"].values[:, 0]
    known = eta_p + log["way_left"].values[:, 0]
    metrics.add("way_points_taken", float(log["way_points"].values[-1, 0]))
    metrics.add("past_known_way", float(np.max(eta - known)))
    metrics.add("travel_time", travel_time(log))
    going = _going(log)
    short = log["way_left"].values[going, 0]
    metrics.add("least_way_left", float(short.min()) if short.size else math.nan)
    return metrics


def _going(log: RunLog) -> np.ndarray:
    """Return the samples with moving reference that is not about to end, shape (samples,)."""
    speed = np.gradient(log["eta_p"].values[:, 0], log.time) if log.time.size > 1 else np.zeros(1)
    running = log["stream_status"].values[:, 0] == StreamStatus.RUNNING
    return np.asarray((speed > _GOES) & running)


def travel_time(log: RunLog) -> float:
    """Return the time from the tool's departure to its arrival [s]."""
    eta = log["eta_p"].values[:, 0]
    on = np.flatnonzero(np.abs(eta - eta[0]) > _ARRIVED)
    if not on.size:
        return math.nan
    off = np.flatnonzero(np.abs(eta - eta[-1]) > _ARRIVED)
    return float(log.time[off[-1]] - log.time[on[0]])


def draw_stream(log: RunLog) -> style.Drawing:
    """Draw speed with its curvature limit, remaining path, and waypoints over time.

    Args:
        log: With ``way_left``, ``bend_speed``, ``way_points``, ``stream_status``.
    """
    canvas, (speed, left, points) = style.make_panels(3, height=2.0)
    speed.plot(log.time, log["eta_dot"].values, color="C0", label="tool")
    limit = log["bend_speed"].values
    speed.plot(log.time, limit, "--", color=style.REFERENCE, label="curvature limit")
    speed.set(ylabel="m/s", title="Speed along the path")
    remaining = log["way_left"].values[:, 0]
    left.plot(log.time, _MM * remaining, color="C1")
    left.axhline(0.0, color=style.REFERENCE, linewidth=0.8)
    left.set(ylabel="mm", title="Remaining known path")
    points.step(log.time, log["way_points"].values[:, 0], where="post", color="C2")
    ends = log["stream_status"].values[:, 0] >= StreamStatus.ENDING
    style.shade([speed, left, points], log.time, ends, "stops at the last one", "#E5E7EB")
    points.set(ylabel="waypoints", xlabel="t in s", title="Accepted waypoints")
    style.add_legend(speed)
    caption = (
        "Speed of the tool along its path, and limit by curvature; length of the known path ahead; "
        "number of accepted waypoints."
    )
    return style.Drawing("stream", "Streamed waypoints", caption, canvas)


FEATURE = Feature(
    signals=add_stream,
    metrics=lambda log, station, settings: stream_metrics(log),
    requirements=lambda settings: {"past_known_way": Target(f"<= {_PAST:g}", "distance to stop")},
    always=("past_known_way",),
    figures={"stream": draw_stream},
)
