"""Waypoints that come while the tool moves."""

import math

import numpy as np

from diagrams.scenario import Target
from diagrams.station import Station
from experiments.results.feature import Feature, Raw
from experiments.results.run_log import RunLog
from pfsc_drake.control.streams.messages import StreamStatus
from reporting import style
from reporting.metrics import Metrics

_GOES = 1e-3  # m/s, from which on the tool counts as on its way
# m, by which a tool may be past the end of what it knows of its path: it follows its reference
_PAST = 1e-3
_ARRIVED = 1e-3  # m, from where it ends
_MM = 1e3


def add_stream(log: RunLog, station: Station, raw: Raw) -> None:
    """Add what became of way points.

    Args:
        log: To add to; nothing where the path is known beforehand.
        station: The station that was simulated.
        raw: What it logged.
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
    """Return the metrics of a path whose way points come; none of another.

    ``past_known_way`` is how far the tool was beyond the end of what the way points that had come
    make of the path, on the truth; negative if it always stayed before.

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
    """Return at which samples the reference is on its way, not about to end, (samples,)."""
    speed = np.gradient(log["eta_p"].values[:, 0], log.time) if log.time.size > 1 else np.zeros(1)
    running = log["stream_status"].values[:, 0] == StreamStatus.RUNNING
    return np.asarray((speed > _GOES) & running)


def travel_time(log: RunLog) -> float:
    """Return the time from when the tool leaves until it is where it ends [s]."""
    eta = log["eta_p"].values[:, 0]
    on = np.flatnonzero(np.abs(eta - eta[0]) > _ARRIVED)
    if not on.size:
        return math.nan
    off = np.flatnonzero(np.abs(eta - eta[-1]) > _ARRIVED)
    return float(log.time[off[-1]] - log.time[on[0]])


def draw_stream(log: RunLog) -> style.Drawing:
    """Speed with what bends allow, the way left, and way points, over time.

    Args:
        log: With ``way_left``, ``bend_speed``, ``way_points``, ``stream_status``.
    """
    canvas, (speed, left, points) = style.make_panels(3, height=2.0)
    speed.plot(log.time, log["eta_dot"].values, color="C0", label="tool")
    limit = log["bend_speed"].values
    speed.plot(log.time, limit, "--", color=style.REFERENCE, label="bends allow")
    speed.set(ylabel="m/s", title="Speed along the path")
    way = log["way_left"].values[:, 0]
    left.plot(log.time, _MM * way, color="C1")
    left.axhline(0.0, color=style.REFERENCE, linewidth=0.8)
    left.set(ylabel="mm", title="Way left that is known")
    points.step(log.time, log["way_points"].values[:, 0], where="post", color="C2")
    ends = log["stream_status"].values[:, 0] >= StreamStatus.ENDING
    style.shade([speed, left, points], log.time, ends, "goes to the last one, to rest", "#E5E7EB")
    points.set(ylabel="way points", xlabel="t in s", title="Way points taken")
    style.place_legend(speed)
    caption = (
        "Speed of the tool along its path, and what bends allow where it is; how far the path is "
        "known ahead of it; how many way points have been taken."
    )
    return style.Drawing("stream", "Way points on the fly", caption, canvas)


FEATURE = Feature(
    signals=add_stream,
    metrics=lambda log, station, settings: stream_metrics(log),
    requirements=lambda settings: {"past_known_way": Target(f"<= {_PAST:g}", "room to stop")},
    always=("past_known_way",),
    figures={"stream": draw_stream},
)
