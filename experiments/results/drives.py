"""Drives and joints of a run: how near to limits, what a reference asks; what their link did.

A simulated joint goes on beyond its limits, a real one does not. Signals used, as in the log:
``q_J``, ``v_J`` and ``tau_d`` [samples, axes], the latter with attribute ``limits``,
``saturated_drives`` and ``fault`` [samples, 1]; of a link ``status_age`` and ``clipped``.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diagrams.station import Station
from experiments.results.fastest import fastest_metrics
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.estimation.momentum import drive_momentum
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.supervision import DRIVE_MEMORY
from pfsc_drake.following.planning.drive_plan import DrivePlan
from pfsc_drake.robot.coordinate_text import coordinate_text
from pfsc_drake.robot.robot_model import RobotModel, largest_speeds
from reporting.metrics import Metrics

# relative; a limit that is missed by rounding is not passed
_ROUNDING = 1e-9
# names of the position metric by whether a joint turns
_MARGIN = {True: "joint_limit_margin", False: "slide_limit_margin"}
_SHARE = "joint_velocity_share"
SATURATION_MARGIN = 1e-9  # relative; a clipped command equals the limit up to rounding


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
        """Return the names of the metrics that :meth:`metrics` gives."""
        bounded = np.isfinite(self.position).any(axis=1)
        names = [name for kind, name in _MARGIN.items() if (bounded & self._turns(kind)).any()]
        return [*names, *([_SHARE] if np.isfinite(self.velocity).any() else [])]

    def metrics(self, log: RunLog) -> Metrics:
        """Return how near a run came to the limits, with joint and time as the source.

        ``joint_limit_margin`` [rad] is the least distance of a turning joint from a limit of its
        position, negative if it passed it; ``slide_limit_margin`` [m] that of a sliding one.
        ``joint_velocity_share`` is the largest ratio of a joint's speed to its limit. Each is
        there if a joint has such a limit. What is not a number does not count.

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
        """Return one sentence for each limit that a run passed.

        Args:
            log: With ``q_J`` and ``v_J``.
        """
        return [*self._passed_positions(log), *self._passed_velocities(log)]

    def _passed_positions(self, log: RunLog) -> Iterator[str]:
        q, rounding = log["q_J"].values, _ROUNDING * np.maximum(1.0, np.abs(self.position))
        for i, name in enumerate(self.names):
            for side, sign in enumerate((-1.0, 1.0)):
                beyond = sign * (q[:, i] - self.position[i, side])
                passed = np.flatnonzero(beyond > rounding[i, side])
                if not passed.size:
                    continue
                farthest = int(np.nanargmax(beyond))
                limit, reached = (
                    coordinate_text(value, revolute=bool(self.revolute[i]))
                    for value in (self.position[i, side], q[farthest, i])
                )
                yield (
                    f"joint {i + 1} '{name}' passes its limit of {limit} at "
                    f"t = {log.time[passed[0]]:.3f} s and reaches {reached} at "
                    f"t = {log.time[farthest]:.3f} s; the simulation lets it pass"
                )

    def _passed_velocities(self, log: RunLog) -> Iterator[str]:
        share, v = self._share(log), log["v_J"].values
        for i, name in enumerate(self.names):
            passed = np.flatnonzero(share[:, i] > 1.0 + _ROUNDING)
            if not passed.size:
                continue
            fastest = int(np.nanargmax(share[:, i]))
            limit, reached = (
                coordinate_text(value, revolute=bool(self.revolute[i]))
                for value in (self.velocity[i], abs(v[fastest, i]))
            )
            yield (
                f"joint {i + 1} '{name}' passes its speed limit of {limit}/s at "
                f"t = {log.time[passed[0]]:.3f} s and reaches {reached}/s at "
                f"t = {log.time[fastest]:.3f} s; the simulation lets it pass"
            )

    def _turns(self, kind: object) -> NDArray[np.bool_]:
        """Return which joints turn, or which do not, shape (N,)."""
        return np.asarray(self.revolute == kind)

    def _share(self, log: RunLog) -> FloatArray:
        """Return the ratios of the speeds to their limits, shape (samples, N)."""
        return np.abs(log["v_J"].values) / self.velocity


def _least(values: FloatArray, log: RunLog) -> tuple[float, str | None]:
    """Return the least of some joints' values, shape (samples, N), and where it is."""
    known = np.where(np.isnan(values), np.inf, values)
    if not np.isfinite(known).any():
        return np.nan, None
    k, i = np.unravel_index(np.argmin(known), known.shape)
    return float(known[k, i]), f"q_{i + 1} at t = {log.time[k]:.3f} s"


def peak_torque(log: RunLog) -> FloatArray:
    """Largest magnitude of the drive torque of each axis.

    Args:
        log: With ``tau_d``.

    Returns:
        [axes] in the unit of ``tau_d``.
    """
    values = np.abs(log["tau_d"].values)
    return np.asarray(np.max(values, axis=0) if len(values) else np.full(values.shape[1], math.nan))


def saturation_count(log: RunLog) -> int:
    """Number of samples at which the law or a drive is at a limit, see :func:`is_saturated`.

    Args:
        log: Log of the run.

    Returns:
        Between 0 and the number of samples.
    """
    return int(np.count_nonzero(is_saturated(log)))


def saturation_warnings(log: RunLog) -> list[str]:
    """Return what there is to say about drives at their limits, one sentence each.

    Args:
        log: As for :func:`is_saturated`.
    """
    saturated = is_saturated(log)
    count = int(np.count_nonzero(saturated))
    if not count:
        return []
    first = float(log.time[int(saturated.argmax())])
    where = ""
    if "eta" in log:
        eta = log["eta"].values[int(saturated.argmax())]
        where = f", eta = {', '.join(f'{x:.3g}' for x in eta)} m"
    return [
        f"drives were at a limit in {count} samples, {100.0 * count / saturated.size:.2g} % of "
        f"the run, first at {first:.3f} s{where}: while they are, nothing that the law promises "
        "holds"
    ]


def limit_reversals(log: RunLog) -> float:
    """Return the most turns of any drive's torque from limit to limit, while there is no fault.

    As :class:`~pfsc_drake.control.law.supervision.DriveWatch` counts what the law commands, with
    the same forgetting; here it is what drives apply, also behind velocity servos.

    Args:
        log: With ``tau_d``, its limits, and ``fault``.
    """
    signal = log["tau_d"]
    assert signal.limits is not None  # of drives
    followed = log["fault"].values[:, 0] == Fault.NONE
    at_limit = np.abs(signal.values) >= signal.limits * (1.0 - SATURATION_MARGIN)
    most = 0.0
    for torque, counted in zip(signal.values.T, (at_limit & followed[:, None]).T, strict=True):
        time, side = log.time[counted], np.sign(torque[counted])
        turns, last = 0.0, -np.inf
        for turned in time[1:][side[1:] != side[:-1]]:
            turns = turns * np.exp((last - turned) / DRIVE_MEMORY) + 1.0
            most, last = max(most, turns), turned
    return most


def is_saturated(log: RunLog) -> np.ndarray:
    """Return at which samples the law or a drive is at a limit, shape (samples,).

    That is, while there is no fault the law asks of a drive more than it may: torque, or with
    velocity servos speed (``saturated_drives``); or the torque of a drive is at its limit,
    whoever commands it: the law, a servo, or the safe state after a fault.

    Args:
        log: With ``tau_d`` and its ``limits``, or ``saturated_drives`` with ``fault``, or both;
            nothing of the others counts.
    """
    saturated = np.zeros(log.time.size, dtype=bool)
    if "tau_d" in log and (signal := log["tau_d"]).limits is not None:
        at_limit = np.abs(signal.values) >= signal.limits * (1.0 - SATURATION_MARGIN)
        saturated |= np.any(at_limit, axis=1)
    if "saturated_drives" in log:
        asked = log["saturated_drives"].values[:, 0] > 0
        # after a fault the drives do not follow the law
        saturated |= asked & (log["fault"].values[:, 0] == Fault.NONE)
    return saturated


def plan_metrics(plan: DrivePlan | None) -> Metrics:
    """Return the shares of the drives' limits that a reference takes, and how it was slowed.

    Args:
        plan: Plan of the reference; None where nobody planned it.
    """
    metrics = Metrics()
    if plan is None or not len(plan.times):
        return metrics
    joints = len(plan.limits) // 2
    metrics.update(fastest_metrics(plan))
    shares = {"planned" if plan.limiting else "asked": plan.asked}
    if plan.is_slowed:
        shares["planned"] = plan.demand
        metrics.add("slowest_pace", float(plan.pace.min()))
        metrics.add("waiting_time", float(plan.waiting_time))
    # drives whose limits nobody knows have no share of them
    limited = np.isfinite(plan.limits[:joints]).any()
    for name, demand in shares.items() if limited else ():
        share = np.max(np.abs(demand[:, :joints]) / plan.limits[:joints])
        metrics.add(f"{name}_torque_share", float(share))
    return metrics


_COEFFICIENTS = {"f_c": "coulomb", "f_v": "viscous"}


def add_friction(log: RunLog, station: Station, raw: dict[str, FloatArray]) -> None:
    """Add friction, its estimate, and the momenta and coefficients if those are estimated.

    Args:
        log: Log of the run.
        station: The station that was simulated.
        raw: What its station logged.
    """
    if "friction_torque" in raw:
        log.add("tau_f", raw["friction_torque"])
    if "friction_estimate" not in raw:
        return
    estimate, axes = raw["friction_estimate"], station.robot.dimension
    parts = np.split(estimate, estimate.shape[1] // axes, axis=1)
    names = ("friction_estimate", "f_c_estimate", "f_v_estimate")
    for name, part in zip(names, parts, strict=False):
        log.add(name, part)
    if len(parts) == 1:
        return
    if "tau_f" in log:
        friction = station.diagram.GetSubsystemByName("joint_friction")
        for name, values in zip(("f_c", "f_v"), friction.coefficients(log.time), strict=True):
            log.add(name, values)
    log.add("momentum", _momentum(station, raw["joint_state"]))


def friction_metrics(log: RunLog) -> Metrics:
    """Return the metrics of friction that the log has signals for.

    Errors of coefficients are those at the last sample, of each axis and of the worst.
    """
    metrics = Metrics()
    if log.time.size == 0:
        return metrics
    if "friction_estimate" in log and "tau_f" in log:
        error = log["friction_estimate"].values - log["tau_f"].values
        for axis, rms in enumerate(np.sqrt(np.mean(error**2, axis=0)), start=1):
            metrics.add(f"rms_friction_error_{axis}", float(rms), log["tau_f"].unit)
    for name, kind in _COEFFICIENTS.items():
        if f"{name}_estimate" not in log or name not in log:
            continue
        errors = np.abs(relative_errors(log, name)[-1])
        metrics.add(f"max_{kind}_error", float(np.nanmax(errors, initial=0.0)))
        for axis, value in enumerate(errors, start=1):
            metrics.add(f"{kind}_error_{axis}", float(value))
    return metrics


def relative_errors(log: RunLog, name: str) -> FloatArray:
    """Return the errors of estimated coefficients, by the true ones, shape (samples, axes).

    NaN where there is no such friction.

    Args:
        log: With an estimate and its truth.
        name: ``f_c`` or ``f_v``.
    """
    estimate, truth = log[f"{name}_estimate"].values, log[name].values
    return np.asarray(estimate / np.where(truth > 0.0, truth, np.nan) - 1.0)


def _momentum(station: Station, state: FloatArray) -> FloatArray:
    """Return the momenta on which friction acts, shape (samples, N), of App. A's ``D(q) q'``."""
    if len(state) == 0:
        return np.zeros((0, station.robot.dimension))
    function = drive_momentum(station.robot).function.map(len(state))
    return np.array(function(state.T)[0]).T


def link_metrics(log: RunLog) -> Metrics:
    """Return what the link did, if there was one.

    Args:
        log: Log of the run.
    """
    metrics = Metrics()
    if "status_age" not in log:
        return metrics
    ages = log["status_age"].values[:, 0]
    ages = ages[np.isfinite(ages)]
    median, p99 = np.percentile(ages, [50, 99]) if len(ages) else (np.nan, np.nan)
    metrics.add("link_answer_us", float(median))
    metrics.add("link_answer_us_p99", float(p99))
    metrics.add("missed_ticks", int(np.isnan(log["status_age"].values).sum()))
    metrics.add("clipped_ticks", int(np.count_nonzero(log["clipped"].values)))
    if "sent_difference" in log:
        difference = log["sent_difference"]
        largest = float(difference.values.max(initial=0.0))
        metrics.add("largest_sent_difference", largest, difference.unit)
    return metrics
