"""Robots at rest: vibration with resting reference, and motion after a fault.

Signals used, as in the log: the references ``eta_p``, ``xi_p``, ``phi_p`` and ``q_posture``, if
they exist, ``tau_d`` [samples, axes] with its limits, ``q_J``, ``v_J`` [samples, axes] and ``y_t``
[samples, 3], the actual tool point; for a moving workpiece ``turntable_angles``, or references and
torques of its robot.
"""

import numpy as np

from diagrams.holder_station import HOLDER
from diagrams.scenario import Scenario, Target
from diagrams.station import Station
from experiments.results.feature import Feature, converged_after
from experiments.results.joint_limits_feature import DriveLimitsOfRun
from experiments.results.run_log import FloatArray, RunLog
from reporting.metrics import Metrics, format_quantity

# s; shortest rest, its evaluated part, and the part left out at its end: there a motion begins
# whose derivatives are felt before its speed is
_SHORTEST, _WINDOW, _LEFT_OUT = 0.5, 0.2, 0.02
# rate of a resting reference [m/s or rad/s]; a posture converges slowly
_RESTS, _POSTURE_RESTS = 1e-6, 1e-4
# of a path, and of the workpiece robot
_COORDINATES = ("eta_p", "xi_p", "phi_p")
_REFERENCES = (
    *_COORDINATES,
    *(f"{HOLDER}{name}" for name in _COORDINATES),
    *("q_posture", "turntable_angles"),
)
_TORQUES = ("tau_d", f"{HOLDER}tau_d")
# allowed share of a drive's limit, peak to peak, and speed of the tool [m/s] at rest
_ALLOWED_AT_REST = {"rest_vibration": 0.02, "rest_speed": 2e-3}
# names of the metric by whether a joint turns
_MOTION = {True: "motion_after_fault", False: "slide_motion_after_fault"}
# units of a joint's position, and allowed motion beside that of the stop
_UNITS, _ALLOWED = {True: "rad", False: "m"}, {True: 0.1, False: 0.02}
# s, longest allowed stop; with the rate 1 - 3 x^2 + 2 x^3 it takes half of v T
_LONGEST_STOP = 1.0
# speed of a joint that rests [rad/s or m/s]
_AT_REST = 0.01
# least reported change of a position [rad or m]
_WORTH_A_WORD = 1e-3


def rest_metrics(log: RunLog, begin: float) -> Metrics:
    """Return vibration of drives and tool over 0.2 s at the end of each rest of the references.

    ``rest_vibration`` is the largest torque, peak to peak, as a share of the drive's limit,
    ``rest_speed`` the largest speed of the tool on the workpiece [m/s]. Rests below 0.5 s and
    motion after a fault do not count.

    Args:
        log: Log of a run.
        begin: End of the approach to the path [s].
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


def _vibration(log: RunLog, name: str, window: slice) -> tuple[float, str]:
    """Return the largest share of a limit, peak to peak, and the axis."""
    signal = log[name]
    limits = np.inf if signal.limits is None else np.max(np.abs(signal.limits.T), axis=0)
    shares = np.ptp(signal.values[window], axis=0) / limits
    axis = int(np.argmax(shares))
    whose = "" if name == "tau_d" else " of the workpiece robot"
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


def _metrics(log: RunLog, station: Station, settings: Scenario) -> Metrics:
    metrics = rest_metrics(log, converged_after(settings, log))
    if "fault_time" in log.attributes and log.time.size:
        metrics |= MotionAfterFault(log, DriveLimitsOfRun.of(station.robot)).metrics()
    return metrics


class MotionAfterFault:
    """Motion of the joints and the tool from a fault to the end of a log.

    Args:
        log: Log of a run with a fault, its time in the attribute ``fault_time``.
        limits: Names and kinds of the joints.
    """

    def __init__(self, log: RunLog, limits: DriveLimitsOfRun) -> None:
        begin = float(log.attributes["fault_time"])
        first = min(int(np.searchsorted(log.time, begin - 1e-9)), log.time.size - 1)
        q, v = (log[name].values[first:] for name in ("q_J", "v_J"))
        self._limits, self._end = limits, float(log.time[-1])
        self._moved = _farthest(q - q[0])
        allowance = np.where(limits.revolute, _ALLOWED[True], _ALLOWED[False])
        self._allowed = 0.5 * _LONGEST_STOP * np.abs(v[0]) + allowance
        self._speed = np.abs(v[-1])
        y_t = log["y_t"].values[first:]
        self._tool = float(np.nanmax(np.linalg.norm(y_t - y_t[0], axis=1), initial=0.0))

    @property
    def rests(self) -> bool:
        """Whether all joints rest at the end."""
        return bool(np.all(self._speed < _AT_REST))

    def metrics(self) -> Metrics:
        """Return the largest motion of a joint relative to its allowed stop, with its bound.

        ``motion_after_fault`` [rad] of revolute joints, ``slide_motion_after_fault`` [m] of
        prismatic ones. The bound is 0.1 rad or 20 mm beyond a stop within one second from the speed
        at the fault.
        """
        metrics, share = Metrics(), self._moved / self._allowed
        for kind, name in _MOTION.items():
            own = np.flatnonzero(self._limits.revolute == kind)
            if own.size:
                worst = int(own[np.argmax(share[own])])
                metrics.add(name, self._moved[worst], source=f"joint {worst + 1}")
                metrics.set_target(name, f"<= {self._allowed[worst]:.3g}")
        return metrics

    def sentence(self) -> str:
        """Return a sentence about the motion, for the last line of a run."""
        state = "stopped" if self.rests else "still moving"
        words, i = [f"{state} at t = {self._end:.3f} s"], int(np.argmax(self._moved))
        if not self.rests:
            fastest = int(np.argmax(self._speed))
            speed = f"{self._speed[fastest]:.3g} {self._unit(fastest)}/s"
            words = [f"{words[0]}, joint {fastest + 1} at {speed}"]
        if self._moved[i] > _WORTH_A_WORD:
            joint = format_quantity(float(self._moved[i]), self._unit(i))
            tool = format_quantity(self._tool, "m")
            words.append(f"after the fault joint {i + 1} moved {joint}, the tool {tool}")
        return "; ".join(words)

    def _unit(self, joint: int) -> str:
        return _UNITS[bool(self._limits.revolute[joint])]


def _farthest(travel: FloatArray) -> FloatArray:
    """Return the largest magnitude of each column, shape (N,); NaN does not count."""
    return np.asarray(np.nanmax(np.abs(travel), axis=0, initial=0.0))


FEATURE = Feature(
    metrics=_metrics,
    requirements=lambda settings: {
        name: Target(f"<= {bound:g}", "a robot at rest does not vibrate")
        for name, bound in _ALLOWED_AT_REST.items()
    },
    always=tuple(_MOTION.values()),
)
