"""Records of a moving robot, and checks of their validity."""

from dataclasses import dataclass

import numpy as np

from identification.model.subject import Subject
from pfsc_drake.errors import InputError

# signals of a record beside the time: a value per sample and joint
SIGNALS = ("q", "tau", "v", "a", "q_motor")
REQUIRED_SIGNALS = ("q", "tau")
_FEWEST_SAMPLES = 10
_JITTER = 0.1  # of the sampling time, tolerated deviation of samples from an even grid
_DEGREES = 180.0 / np.pi
# tolerances of positions and velocities beyond their limits: part of them, plus
_BEYOND, _SLACK = 0.02, 0.02  # rad or m
_STRETCH = 0.02  # s, interval of difference quotients for comparison with velocity limits
# a number beyond its limit by more than this has another unit
_OTHER_UNIT = 5.0
_FAR = 3.0  # times the largest limit, from which on another unit is suspected
_REACHES = 1e-3  # part of a limit, tolerance of a clipped torque
# samples at the extreme value in a plateau, and its least length compared to the steps next to it;
# the top of a parabola that is rounded to steps is up to 5 times as long as these
_PLATEAU, _FLAT = 5, 10.0


@dataclass(frozen=True, eq=False)
class Record:
    """Signals of N joints at K instants, in SI units, on the joint side.

    Attributes:
        t: Time [s], shape (K,), increasing.
        q: Positions of the links, or of the joints if they are rigid [rad or m], shape (K, N).
        tau: Drive torques or forces ``tau_d`` [Nm or N], shape (K, N).
        joint_names: N names.
        period: Period of the motion [s], or None if it is not periodic.
        v: Velocities, if measured, shape (K, N).
        a: Accelerations, if measured, shape (K, N).
        q_motor: Positions of the motors on the joint side, if measured [rad or m], shape (K, N).
        source: Source of the record, for messages.

    Raises:
        InputError: If shapes differ, a value is NaN or infinite, time does not increase, or the
            period is not positive.
    """

    t: np.ndarray
    q: np.ndarray
    tau: np.ndarray
    joint_names: tuple[str, ...]
    period: float | None = None
    v: np.ndarray | None = None
    a: np.ndarray | None = None
    q_motor: np.ndarray | None = None
    source: str = "record"

    def __post_init__(self) -> None:
        shape = (np.size(self.t), len(self.joint_names))
        self._check_time()
        for signal in SIGNALS:
            values = getattr(self, signal)
            if values is None:
                continue
            if np.shape(values) != shape:
                raise InputError(
                    f"{self.source}: {signal} of shape {np.shape(values)}; must be {shape}, "
                    "samples by joints"
                )
            bad = np.argwhere(~np.isfinite(values))
            if bad.size:
                row, joint = bad[0]
                raise InputError(
                    f"{self.source}: {signal} of {self.joint_names[joint]} is {values[row, joint]} "
                    f"at t = {self.t[row]:.6g} s ({len(bad)} such values in all); finite numbers "
                    "are required"
                )
        if self.period is not None and not 0.0 < self.period < np.inf:
            raise InputError(f"{self.source}: period = {self.period} s; must be positive")

    def _check_time(self) -> None:
        t = np.asarray(self.t)
        if t.ndim != 1 or t.size < _FEWEST_SAMPLES:
            raise InputError(
                f"{self.source}: t of shape {t.shape}; at least {_FEWEST_SAMPLES} samples are "
                "required"
            )
        if not np.isfinite(t).all():
            raise InputError(
                f"{self.source}: t is {t[~np.isfinite(t)][0]} in sample "
                f"{np.argmin(np.isfinite(t)) + 1}; finite numbers are required"
            )
        steps = np.diff(t)
        if steps.min() <= 0.0:
            k = int(np.argmax(steps <= 0.0))
            raise InputError(
                f"{self.source}: t does not increase from sample {k + 1} ({t[k]:.6g} s) to the "
                f"next ({t[k + 1]:.6g} s); must do so throughout"
            )

    @property
    def dimension(self) -> int:
        """Number of joints N."""
        return len(self.joint_names)

    @property
    def sampling_time(self) -> float:
        """Mean distance of two samples [s]."""
        return float((self.t[-1] - self.t[0]) / (self.t.size - 1))

    @property
    def duration(self) -> float:
        """Duration of all samples, each one sampling time [s]."""
        return self.t.size * self.sampling_time


def check_record(record: Record, robot: Subject, still: bool = False) -> None:
    """Refuse a record that is not valid or cannot belong to the robot.

    The checks are: gaps in time, samples that are not evenly spaced, other joints than the robot's,
    positions and velocities far beyond its limits (with a hint at degrees or millimetres), constant
    signals, and clipped torques. See
    :mod:`~identification.measurement.synchronization` for signals that do not fit together.

    Args:
        record: The record.
        robot: Expected robot of the record.
        still: Whether the links may stand still, as those of locked joints do.

    Raises:
        InputError: With joint, time and value of the first problem.
    """
    if list(record.joint_names) != list(robot.joint_names):
        raise InputError(
            f"{record.source}: joints {', '.join(record.joint_names)}; must be those of "
            f"{robot.name}: {', '.join(robot.joint_names)}"
        )
    check_sampling(record)
    _check_positions(record, robot, still)
    _check_velocities(record, robot)
    _check_torques(record, robot)


def check_sampling(record: Record) -> None:
    """Refuse gaps in time and samples that are not evenly spaced; names the time."""
    t, steps = record.t, np.diff(record.t)
    usual = float(np.median(steps))
    k = int(np.argmax(steps > 1.5 * usual))
    if steps[k] > 1.5 * usual:
        count = int(np.sum(steps > 1.5 * usual))
        raise InputError(
            f"{record.source}: gap of {steps[k]:.6g} s in t after {t[k]:.6g} s, about "
            f"{round(steps[k] / usual) - 1} samples ({count} gaps in all); the samples must be "
            f"{usual:.6g} s apart throughout"
        )
    even = np.linspace(t[0], t[-1], t.size)
    worst = int(np.argmax(np.abs(t - even)))
    if abs(t[worst] - even[worst]) > _JITTER * usual:
        raise InputError(
            f"{record.source}: samples are {steps.min():.6g} to {steps.max():.6g} s apart, and "
            f"that at {t[worst]:.6g} s is {abs(t[worst] - even[worst]):.3g} s off an even grid; "
            f"allowed: {_JITTER * usual:.3g} s, record at a fixed rate or resample"
        )


def _check_positions(record: Record, robot: Subject, still: bool) -> None:
    for name, positions in (("q", record.q), ("q_motor", record.q_motor)):
        if positions is None:
            continue
        travel = np.ptp(positions, axis=0)
        if not travel.any() and not (still and name == "q"):
            raise InputError(
                f"{record.source}: {name} of all joints is constant; a robot that moves is required"
            )
        lower, upper = np.asarray(robot.position_limits, dtype=float).T
        excess = np.maximum(positions.max(axis=0) - upper, lower - positions.min(axis=0))
        j = int(np.argmax(excess))
        if excess[j] <= _BEYOND * (upper[j] - lower[j]) + _SLACK:
            continue
        far = positions[np.argmax(np.abs(positions[:, j])), j]
        limit = max(abs(lower[j]), abs(upper[j]))
        raise InputError(
            f"{record.source}: {name} of {record.joint_names[j]} reaches {far:.5g} "
            f"{robot.joint_units[j]}, {abs(far) / limit:.3g} times its limit; "
            f"{_explanation(positions, lower, upper, robot, j)}"
        )


def _explanation(
    positions: np.ndarray, lower: np.ndarray, upper: np.ndarray, robot: Subject, joint: int
) -> str:
    """Return a possible reason for positions beyond the limits."""
    revolute = robot.joint_units[joint] == "rad"
    factor, unit = (_DEGREES, "deg") if revolute else (1e3, "mm")
    alike = np.array([u == robot.joint_units[joint] for u in robot.joint_units])
    far = np.abs(positions[:, alike]).max() > _FAR * np.abs([lower, upper]).T[alike].max()
    q, slack = positions[:, alike] / factor, _BEYOND * (upper - lower)[alike] + _SLACK
    if far and np.all((q >= lower[alike] - slack) & (q <= upper[alike] + slack)):
        return f"divided by {factor:.4g} all fit, so they look like [{unit}]"
    return (
        f"allowed: {lower[joint]:.5g} to {upper[joint]:.5g} {robot.joint_units[joint]}, so sign, "
        "zero, unit or order of the joints are others than the model's"
    )


def _check_velocities(record: Record, robot: Subject) -> None:
    stride = max(1, round(_STRETCH / record.sampling_time))
    if record.t.size <= stride:
        return
    rates = [
        ("q changes by", (record.q[stride:] - record.q[:-stride]) / (stride * record.sampling_time))
    ]
    if record.v is not None:
        rates.append(("v is", record.v))
    for what, values in rates:
        fastest = np.abs(values).max(axis=0)
        j = int(np.argmax(fastest / robot.velocity_limit))
        ratio = float(fastest[j] / robot.velocity_limit[j])
        if ratio <= 1.0 + 5.0 * _BEYOND:
            continue
        hint = "unit of q or t?" if ratio > _OTHER_UNIT else "is the limit the robot's?"
        raise InputError(
            f"{record.source}: {what} {fastest[j]:.4g} {robot.joint_units[j]}/s in "
            f"{record.joint_names[j]}, {ratio:.3g} times its limit of "
            f"{robot.velocity_limit[j]:.4g}; must stay within ({hint})"
        )


def _check_torques(record: Record, robot: Subject) -> None:
    for j, name in enumerate(record.joint_names):
        tau, limit = record.tau[:, j], float(robot.effort_limit[j])
        unit = "Nm" if robot.joint_units[j] == "rad" else "N"
        if not np.ptp(tau) > 0.0:
            raise InputError(
                f"{record.source}: tau of {name} is {tau[0] + 0.0:g} {unit} throughout; a torque "
                "that was measured is required"
            )
        largest = float(np.abs(tau).max())
        if largest > _OTHER_UNIT * limit:
            raise InputError(
                f"{record.source}: tau of {name} reaches {largest:.4g} {unit}, "
                f"{largest / limit:.3g} times its limit; must stay within {limit:.4g} {unit} "
                "(another unit?)"
            )
        at_limit = np.abs(tau) >= (1.0 - _REACHES) * limit
        if at_limit.sum() >= _PLATEAU:
            raise InputError(
                f"{record.source}: tau of {name} is at the drive's limit of {limit:.4g} {unit} in "
                f"{at_limit.sum()} samples, first at t = {record.t[np.argmax(at_limit)]:.6g} s; "
                "must stay below (move more slowly)"
            )
        for extreme in (tau.max(), tau.min()):
            begin, length = _plateau(tau, extreme)
            if length:
                raise InputError(
                    f"{record.source}: tau of {name} is clipped at {extreme:.5g} {unit}: constant "
                    f"for {length} samples from t = {record.t[begin]:.6g} s; must be the torque "
                    "that acts (move more slowly, or raise the limit of the recorder)"
                )
            begin, count = _pile(tau, extreme)
            if count:
                raise InputError(
                    f"{record.source}: tau of {name} is clipped at {extreme:.5g} {unit}: there in "
                    f"{count} samples, first at t = {record.t[begin]:.6g} s, and hardly ever just "
                    "below; must be the torque that acts (move more slowly, or raise the limit of "
                    "the recorder)"
                )


def _plateau(values: np.ndarray, extreme: float) -> tuple[int, int]:
    """Return the start of a long plateau at an extreme value, and its number of samples, or 0."""
    begins, lengths = _runs(values)
    at = np.flatnonzero(np.abs(values[begins] - extreme) <= 1e-9 * np.ptp(values))
    longest = at[np.argmax(lengths[at])]
    beside = lengths[max(longest - 1, 0) : longest + 2].tolist()
    beside.remove(lengths[longest])
    flat = lengths[longest] > _FLAT * max(beside, default=1)
    if lengths[longest] < _PLATEAU or not flat:
        return 0, 0
    return int(begins[longest]), int(lengths[longest])


def _pile(values: np.ndarray, extreme: float) -> tuple[int, int]:
    """Return the first sample of a noisy signal at a frequent extreme value, and their number.

    Clipping after the noise leaves no plateaus, but many samples at the limit. Both are 0 if values
    next to it are as frequent, as in rounded signals.
    """
    digit = 1e-9 * np.ptp(values)
    levels, counts = np.unique(np.round(np.abs(values - extreme) / digit), return_counts=True)
    often = counts[0] >= 2 * _PLATEAU and counts[0] > _FLAT * counts[1 : 1 + _PLATEAU].max()
    if levels[0] != 0.0 or not often:
        return 0, 0
    return int(np.argmax(np.abs(values - extreme) <= digit)), int(counts[0])


def _runs(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the starts of runs of equal values, and their lengths."""
    begins = np.flatnonzero(np.append(True, np.diff(values) != 0.0))
    return begins, np.diff(np.append(begins, values.size))
