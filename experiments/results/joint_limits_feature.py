"""Joint limits: margins of a run, or violations.

A simulated joint does not stop at its limits. Signals used, as in the log: ``q_J``, ``v_J``
[samples, axes].
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.results.feature import Feature
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.robot.coordinate_text import coordinate_text
from pfsc_drake.robot.robot_model import RobotModel, largest_speeds
from reporting.metrics import Metrics

# relative; exceeding a limit by rounding is no violation
_ROUNDING = 1e-9
# names of the position metric by whether a joint turns
_MARGIN = {True: "joint_limit_margin", False: "slide_limit_margin"}
_SHARE = "joint_velocity_share"


@dataclass(frozen=True)
class DriveLimitsOfRun:
    """Limits of N joints; infinite where there are none.

    Attributes:
        names: Names of the joints.
        revolute: Whether they turn (else they slide), shape (N,).
        position: Lower and upper limits [rad or m], shape (N, 2).
        velocity: Largest speeds [rad/s or m/s], shape (N,).
    """

    names: list[str]
    revolute: NDArray[np.bool_]
    position: FloatArray
    velocity: FloatArray

    @classmethod
    def of(cls, robot: RobotModel) -> "DriveLimitsOfRun":
        """Return the limits of a robot.

        Args:
            robot: The robot.
        """
        return cls(
            list(robot.names),
            robot.gather("is_revolute"),
            robot.gather("position_limits"),
            largest_speeds(robot),
        )

    def metric_names(self) -> list[str]:
        """Return the names of the metrics of :meth:`metrics`."""
        bounded = np.isfinite(self.position).any(axis=1)
        names = [name for kind, name in _MARGIN.items() if (bounded & self._turns(kind)).any()]
        return [*names, *([_SHARE] if np.isfinite(self.velocity).any() else [])]

    def metrics(self, log: RunLog) -> Metrics:
        """Return the margins of a run to the limits, with joint and time as the source.

        ``joint_limit_margin`` [rad] is the least distance of a revolute joint from its position
        limits, negative beyond; ``slide_limit_margin`` [m] of a prismatic one.
        ``joint_velocity_share`` is the largest ratio of a joint's speed to its limit. Each exists
        if a joint has such a limit. NaN does not count.

        Args:
            log: With ``q_J`` and ``v_J``.
        """
        metrics, known, q = Metrics(), self.metric_names(), log["q_J"].values
        margin = np.minimum(q - self.position[:, 0], self.position[:, 1] - q)
        for kind, name in _MARGIN.items():
            if name in known:
                least = _least(np.where(self._turns(kind), margin, np.inf), log)
                metrics.add(name, least[0], source=least[1])
        if _SHARE in known:
            least = _least(-self._share(log), log)
            metrics.add(_SHARE, -least[0], source=least[1])
        return metrics

    def warnings(self, log: RunLog) -> list[str]:
        """Return one sentence for each violated limit.

        Args:
            log: With ``q_J`` and ``v_J``.
        """
        q, v, share = log["q_J"].values, np.abs(log["v_J"].values), self._share(log)
        rounding, joints = _ROUNDING * np.maximum(1.0, np.abs(self.position)), range(q.shape[1])
        limits = [
            (i, "", limit, q, sign * (q[:, i] - limit) - rounding[i, side])
            for i in joints
            for side, (sign, limit) in enumerate(zip((-1.0, 1.0), self.position[i], strict=True))
        ]
        limits += [(i, "/s", self.velocity[i], v, share[:, i] - 1.0 - _ROUNDING) for i in joints]
        return [text for limit in limits if (text := self._passing(log.time, *limit))]

    def _passing(
        self,
        time: FloatArray,
        i: int,
        per: str,
        limit: float,
        values: FloatArray,
        beyond: FloatArray,
    ) -> str:
        """Return a sentence if a joint is ``beyond`` a limit of position or speed at any time."""
        passed = np.flatnonzero(beyond > 0.0)
        if not passed.size:
            return ""
        farthest = int(np.nanargmax(beyond))
        at, reached = (
            f"{coordinate_text(value, revolute=bool(self.revolute[i]))}{per}"
            for value in (limit, values[farthest, i])
        )
        return (
            f"joint {i + 1} '{self.names[i]}' exceeds its {'speed ' if per else ''}limit of {at} "
            "at "
            f"t = {time[passed[0]]:.3f} s and reaches {reached} at t = {time[farthest]:.3f} s; "
            "the simulation does not stop it"
        )

    def _turns(self, kind: object) -> NDArray[np.bool_]:
        """Return which joints turn, or which do not, shape (N,)."""
        return np.asarray(self.revolute == kind)

    def _share(self, log: RunLog) -> FloatArray:
        """Return the ratios of the speeds to their limits, shape (samples, N)."""
        return np.abs(log["v_J"].values) / self.velocity


def _least(values: FloatArray, log: RunLog) -> tuple[float, str | None]:
    """Return the least of some joints' values, shape (samples, N), with joint and time."""
    known = np.where(np.isnan(values), np.inf, values)
    if not np.isfinite(known).any():
        return np.nan, None
    k, i = np.unravel_index(np.argmin(known), known.shape)
    return float(known[k, i]), f"q_{i + 1} at t = {log.time[k]:.3f} s"


FEATURE = Feature(
    metrics=lambda log, station, settings: DriveLimitsOfRun.of(station.robot).metrics(log),
    known=lambda station, settings: DriveLimitsOfRun.of(station.robot).metric_names(),
    warnings=lambda log, station, settings: DriveLimitsOfRun.of(station.robot).warnings(log),
)
