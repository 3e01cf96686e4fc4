"""What a robot's driver makes of commands: age, mode, rate of torques, low pass."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pfsc_drake.checks import require_between
from pfsc_drake.drivers.messages import ControlMode, RobotCommand, RobotMode
from pfsc_drake.errors import InputError
from pfsc_drake.physics.driver import low_pass_share, torque_rates
from pfsc_drake.yaml.rules import Parameters, Range


@dataclass(frozen=True)
class DriverOptions(Parameters):
    """How a driver treats commands, as drake-franka-driver does unless it is told otherwise.

    Attributes:
        expiry: Age from which a command counts no more [s].
        low_pass: Cut-off frequency of commanded torques [Hz]; 0 for none.
        torque_rate: Largest rate of commanded torques [Nm/s], of strong joints ten times their
            largest torque per second.
        damping: Rate with which joints lose their speed while no command counts [1/s].
    """

    expiry: float = 0.1
    low_pass: float = 30.0
    torque_rate: Annotated[float, Range(0.001, 1000000000.0, "Nm/s")] = 1000.0
    damping: float = 10.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require_between("--expire", self.expiry, 1e-3, 60.0, "s")
        require_between("--low-pass", self.low_pass, 0.0, 1e5, "Hz")
        require_between("--damping", self.damping, 0.0, 1e4, "1/s")


class DriverRules:
    """A driver's memory: the last command, what of it acts, and whether the driver has ended.

    Args:
        inertia: Inertias of the N joints [kg m^2], shape (N,).
        effort: Their largest torques [Nm], shape (N,).
        mode: What the driver is started for.
        options: How it treats commands.
        period: Its sampling time [s].

    Attributes:
        acting: What acts on the drives: torques on top of the weight, or velocities, shape (N,).
        ended: Why it has ended, or None.
        rejected: How many commands were too old.
    """

    def __init__(
        self,
        inertia: np.ndarray,
        effort: np.ndarray,
        mode: ControlMode,
        options: DriverOptions,
        period: float,
    ) -> None:
        self.mode, self.options = mode, options
        self._damping = options.damping * inertia
        self._step = torque_rates(options.torque_rate, effort) * period
        self.acting = np.zeros(len(inertia))
        self.ended: str | None = None
        self.rejected = 0
        self._last: RobotCommand | None = None
        self._pass = low_pass_share(options.low_pass, period)

    @property
    def robot_mode(self) -> RobotMode:
        """What the robot does."""
        return RobotMode.MOVE if self.ended is None else RobotMode.REFLEX

    def advance(self, utime: int, command: RobotCommand | None, v: np.ndarray) -> np.ndarray:
        """Return what acts until the next tick, shape (N,).

        Args:
            utime: The robot's clock [us].
            command: What has come since the last tick, if anything.
            v: Velocities of the joints, shape (N,).
        """
        if command is not None and self.ended is None:
            self._take(utime, command)
        torques, last = self.mode is ControlMode.TORQUE, self._last
        wanted = -self._damping * v if torques else 0.0 * v
        if self.ended is None and last is not None and self._is_fresh(utime, last):
            wanted = last.values
        if not torques:
            self.acting = np.array(wanted)
            return self.acting
        passed = self.acting + self._pass * (wanted - self.acting)
        self.acting = self.acting + np.clip(passed - self.acting, -self._step, self._step)
        return self.acting

    def _is_fresh(self, utime: int, command: RobotCommand) -> bool:
        return abs(utime - command.utime) <= 1e6 * self.options.expiry

    def _take(self, utime: int, command: RobotCommand) -> None:
        if command.mode != self.mode:
            self.ended = f"a command for {command.mode.name}, the driver is in {self.mode.name}"
        elif len(command.values) != len(self.acting):
            count = len(command.values)
            self.ended = f"a command for {count} joints, the robot has {len(self.acting)}"
        elif not np.isfinite(command.values).all():
            self.ended = "a command that is not a finite number"
        elif not self._is_fresh(utime, command):
            self.rejected += 1
        else:
            self._last = command


def check_mode(mode: ControlMode, allowed: ControlMode, driver: str) -> None:
    """Refuse what a driver cannot be commanded by.

    Args:
        mode: What the law commands.
        allowed: What the driver takes.
        driver: Its name, for the message.

    Raises:
        InputError: If it does not.
    """
    if mode not in allowed:
        names = ", ".join(str(m.name) for m in ControlMode if m in allowed and m)
        raise InputError(f"driver {driver}: takes no {mode.name}; allowed: {names}")
