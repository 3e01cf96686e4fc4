"""Vibration of a robot whose reference rests.

Signals used, as in the log: ``eta_p``, ``xi_p`` and ``phi_p`` as far as there are any, ``tau_d``
[samples, axes] and ``y_t`` [samples, 3], where the tool really is.
"""

import numpy as np

from experiments.results.run_log import FloatArray, RunLog
from reporting.metrics import Metrics

# s; of a rest that counts, of what is looked at, and of what comes after: there a motion begins
# whose derivatives are felt before its speed is
_SHORTEST, _WINDOW, _LEFT_OUT = 0.3, 0.2, 0.02
# derivative of a reference that rests [m/s or rad/s]
_RESTS = 1e-6
# share of a drive's limit, peak to peak, and speed of the tool [m/s], that a robot at rest may have
ALLOWED_VIBRATION, ALLOWED_SPEED = 0.02, 2e-3


def rest_metrics(log: RunLog, limits: FloatArray, begin: float) -> Metrics:
    """Return how much drives and tool move over 0.2 s at the end of each rest of the reference.

    ``rest_vibration`` is the largest torque, peak to peak, as a share of the drive's limit,
    ``rest_speed`` the largest speed of the tool [m/s]. Rests below 0.3 s do not count, nor does
    what comes after a fault.

    Args:
        log: Log of a run.
        limits: Limits of the drives, shape (N,) [Nm or N]; infinite where there are none.
        begin: Until when the tool comes to the path [s].
    """
    metrics = Metrics()
    windows = _rests(log, begin) if {"tau_d", "eta_p", "y_t"} <= set(log) else []
    if not windows:
        return metrics
    shares, speeds = [], []
    for window in windows:
        shares.append(np.ptp(log["tau_d"].values[window], axis=0) / limits)
        steps = np.diff(log["y_t"].values[window], axis=0) / np.diff(log.time[window])[:, None]
        speeds.append(np.max(np.linalg.norm(steps, axis=1)))
    at, axis = np.unravel_index(np.argmax(shares), np.shape(shares))
    metrics.add(
        "rest_vibration",
        float(shares[int(at)][axis]),
        source=_source(log, windows[int(at)], int(axis) + 1),
    )
    fastest = int(np.argmax(speeds))
    metrics.add("rest_speed", speeds[fastest], source=_source(log, windows[fastest]))
    return metrics


def rest_warnings(metrics: Metrics) -> list[str]:
    """Return what there is to say about a robot that does not rest, one sentence.

    Args:
        metrics: Of the run.
    """
    if "rest_vibration" not in metrics:
        return []
    shaking, speed = metrics["rest_vibration"], metrics["rest_speed"]
    if shaking.value <= ALLOWED_VIBRATION and speed.value <= ALLOWED_SPEED:
        return []
    return [
        f"the robot vibrates while its reference rests: torque of {shaking.source} by "
        f"{100.0 * shaking.value:.2g} % of its limit, tool at {1e3 * speed.value:.2g} mm/s"
    ]


def _source(log: RunLog, window: slice, axis: int | None = None) -> str:
    at = f"rest until t = {log.time[window.stop - 1]:.3f} s"
    return at if axis is None else f"axis {axis}, {at}"


def _rests(log: RunLog, begin: float) -> list[slice]:
    """Return the ends of the rests of a reference."""
    time = log.time
    moving = np.zeros(time.size - 1, dtype=bool)
    for name in ("eta_p", "xi_p", "phi_p"):
        if name in log:
            rate = np.abs(np.diff(log[name].values, axis=0)) / np.diff(time)[:, None]
            moving |= ~(rate < _RESTS).all(axis=1)
    fault = float(log.attributes.get("fault_time", np.inf))
    moving |= (time[:-1] < begin) | (time[1:] > fault)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], moving, [True]]).astype(int)))
    windows = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if time[last] - time[first] > _SHORTEST - 1e-9:
            end = time[last] - _LEFT_OUT
            ends = np.searchsorted(time, [end - _WINDOW - 1e-9, end + 1e-9])
            windows.append(slice(int(ends[0]), int(ends[1])))
    return windows
