"""Signals and metrics of a path whose way points come while the tool moves."""

import math

import numpy as np

from diagrams.station import Station
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.streams.messages import StreamStatus
from reporting.metrics import Metrics

_GOES = 1e-3  # m/s, from which on the tool counts as on its way
_ARRIVED = 1e-3  # m, from where it ends


def add_stream(log: RunLog, station: Station, raw: dict[str, FloatArray]) -> None:
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
