"""Vibration of a robot whose reference rests.

Signals used, as in the log: the references ``eta_p``, ``xi_p``, ``phi_p`` and ``q_posture`` as far
as there are any, ``tau_d`` [samples, axes] with its limits and ``y_t`` [samples, 3], where the tool
really is; of a workpiece that moves ``turntable_angles``, or references and torques of the robot
that holds it.
"""

import numpy as np

from diagrams.holder_station import HOLDER
from experiments.results.run_log import RunLog
from reporting.metrics import Metrics

# s; of a rest that counts, of what is looked at, and of what comes after: there a motion begins
# whose derivatives are felt before its speed is
_SHORTEST, _WINDOW, _LEFT_OUT = 0.5, 0.2, 0.02
# derivative of a reference that rests [m/s or rad/s]; a posture comes to its end slowly
_RESTS, _POSTURE_RESTS = 1e-6, 1e-4
# of a path, and of a robot that holds the workpiece
_COORDINATES = ("eta_p", "xi_p", "phi_p")
_REFERENCES = (
    *_COORDINATES,
    *(f"{HOLDER}{name}" for name in _COORDINATES),
    *("q_posture", "turntable_angles"),
)
_TORQUES = ("tau_d", f"{HOLDER}tau_d")
# share of a drive's limit, peak to peak, and speed of the tool [m/s], that a robot at rest may have
_ALLOWED_VIBRATION, _ALLOWED_SPEED = 0.02, 2e-3


def rest_metrics(log: RunLog, begin: float) -> Metrics:
    """Return how much drives and tool move over 0.2 s at the end of each rest of the references.

    ``rest_vibration`` is the largest torque, peak to peak, as a share of the drive's limit,
    ``rest_speed`` the largest speed of the tool on the workpiece [m/s]. Rests below 0.5 s do not
    count, nor does what comes after a fault.

    Args:
        log: Log of a run.
        begin: Until when the tool comes to the path [s].
    """
    metrics = Metrics()
    windows = _rests(log, begin) if {"tau_d", "eta_p", "y_t"} <= set(log) else []
    if not windows:
        return metrics
    shaking, speeds = [], []
    for window in windows:
        shaking.append(max(_vibration(log, name, window) for name in _TORQUES if name in log))
        steps = np.diff(log["y_t"].values[window], axis=0) / np.diff(log.time[window])[:, None]
        speeds.append(np.max(np.linalg.norm(steps, axis=1)))
    at = int(np.argmax([share for share, _ in shaking]))
    share, axis = shaking[at]
    metrics.add("rest_vibration", share, source=f"{axis}, {_source(log, windows[at])}")
    at = int(np.argmax(speeds))
    metrics.add("rest_speed", speeds[at], source=_source(log, windows[at]))
    return metrics


def set_rest_targets(metrics: Metrics) -> None:
    """Require that a robot whose references rest does so, too.

    Args:
        metrics: Of the run.
    """
    allowed = {"rest_vibration": _ALLOWED_VIBRATION, "rest_speed": _ALLOWED_SPEED}
    for name, bound in allowed.items():
        if name in metrics:
            metrics.set_target(name, f"<= {bound:g}", "a robot at rest does not vibrate")


def _vibration(log: RunLog, name: str, window: slice) -> tuple[float, str]:
    """Return the largest share of a limit, peak to peak, and the axis."""
    signal = log[name]
    limits = np.inf if signal.limits is None else np.max(np.abs(signal.limits.T), axis=0)
    shares = np.ptp(signal.values[window], axis=0) / limits
    axis = int(np.argmax(shares))
    whose = "" if name == "tau_d" else " of the robot that holds the workpiece"
    return float(shares[axis]), f"axis {axis + 1}{whose}"


def _source(log: RunLog, window: slice) -> str:
    return f"rest until t = {log.time[window.stop - 1]:.3f} s"


def _rests(log: RunLog, begin: float) -> list[slice]:
    """Return the ends of the rests of all references."""
    time = log.time
    moving = np.zeros(time.size - 1, dtype=bool)
    for name in _REFERENCES:
        if name in log:
            rate = np.abs(np.diff(log[name].values, axis=0)) / np.diff(time)[:, None]
            bound = _POSTURE_RESTS if name == "q_posture" else _RESTS
            moving |= ~(rate < bound).all(axis=1)
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
