"""What was measured of a robot while it moved."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pfsc_drake.errors import InputError

# signals of a record beside the time: a value per sample and joint
SIGNALS = ("q", "tau", "v", "a", "q_motor")
REQUIRED_SIGNALS = ("q", "tau")
_FEWEST_SAMPLES = 10


class MeasuredRobot(Protocol):
    """What records are checked against; all on the joint side, N joints."""

    @property
    def name(self) -> str:
        """Name of the robot."""

    @property
    def joint_names(self) -> Sequence[str]:
        """Names of the N joints."""

    @property
    def joint_units(self) -> Sequence[str]:
        """``rad`` or ``m`` for each joint."""

    @property
    def position_limits(self) -> np.ndarray:
        """Limits of the positions [rad or m], shape (N, 2); infinite if unknown."""

    @property
    def velocity_limit(self) -> np.ndarray:
        """Largest velocities [rad/s or m/s], shape (N,); infinite if unknown."""

    @property
    def effort_limit(self) -> np.ndarray:
        """Largest torques [Nm or N], shape (N,); infinite if unknown."""


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
        source: Where it is from, for messages.

    Raises:
        InputError: If shapes differ, a value is no finite number, time does not increase, or the
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
        """Time that the samples stand for, each one sampling time [s]."""
        return self.t.size * self.sampling_time
