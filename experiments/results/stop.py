"""Motion of a robot after a fault: how far it goes, and whether it rests in the end.

Signals used, as in the log: ``q_J``, ``v_J`` [samples, axes] and ``y_t`` [samples, 3].
"""

import numpy as np

from experiments.results.drives import DriveLimitsOfRun
from experiments.results.run_log import FloatArray, RunLog
from reporting.metrics import Metrics, format_quantity

# names of the metric by whether a joint turns
_MOTION = {True: "motion_after_fault", False: "slide_motion_after_fault"}
# units of a joint's position and the motion that is allowed beside that of the stop
_UNITS, _ALLOWED = {True: "rad", False: "m"}, {True: 0.1, False: 0.02}
# s, the longest stop that is allowed; with the rate 1 - 3 x^2 + 2 x^3 it takes half of v T
_LONGEST_STOP = 1.0
# speed of a joint that rests [rad/s or m/s]
_AT_REST = 0.01
# change of a position that is worth a word [rad or m]
_WORTH_A_WORD = 1e-3


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
        """Return the motion of the joint that went farthest beyond its stop, with its bound.

        ``motion_after_fault`` [rad] of joints that turn, ``slide_motion_after_fault`` [m] of
        others. The bound is 0.1 rad or 20 mm beside a stop within a second from the speed at the
        fault.
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
        """Return the motion in words, for the last line of a run."""
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


def _farthest(way: FloatArray) -> FloatArray:
    """Return the largest magnitude of each column, shape (N,); NaN does not count."""
    return np.asarray(np.nanmax(np.abs(way), axis=0, initial=0.0))
