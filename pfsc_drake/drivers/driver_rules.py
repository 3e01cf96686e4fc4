"""Command handling of a robot's driver: age, mode, torque rate, low pass."""

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
    """Command handling of a driver, by default as in drake-franka-driver.

    Attributes:
        expiry: Age from which a command is ignored [s].
        low_pass: Cut-off frequency of commanded torques [Hz]; 0 for none.
        torque_rate: Largest rate of commanded torques [Nm/s]; for strong joints ten times their
            largest torque per second.
        damping: Rate at which joints lose their speed without a valid command [1/s].
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
    """State of a driver: last command, acting command, and end.

    Args:
        inertia: Inertias of the N joints [kg m^2], shape (N,).
        effort: Their largest torques [Nm], shape (N,).
        mode: Control mode that the driver is started in.
        options: Command handling.
        period: Its sampling time [s].

    Attributes:
        acting: Acting command: torques on top of gravity compensation, or velocities, shape (N,).
        ended: Reason of its end, or None.
        rejected: Number of commands that were too old.
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
        """Mode of the robot."""
        return RobotMode.MOVE if self.ended is None else RobotMode.REFLEX

    def advance(self, utime: int, command: RobotCommand | None, v: np.ndarray) -> np.ndarray:
        """Return the acting command until the next tick, shape (N,).

        Args:
            utime: The robot's clock [us].
            command: Command received since the last tick, if any.
            v: Velocities of the joints, shape (N,).
        """
        if command is not None and self.ended is None:
            self._accept(utime, command)
        torques, last = self.mode is ControlMode.TORQUE, self._last
        desired = -self._damping * v if torques else 0.0 * v
        if self.ended is None and last is not None and self._is_fresh(utime, last):
            desired = last.values
        if not torques:
            self.acting = np.array(desired)
            return self.acting
        filtered = self.acting + self._pass * (desired - self.acting)
        self.acting = self.acting + np.clip(filtered - self.acting, -self._step, self._step)
        return self.acting

    def _is_fresh(self, utime: int, command: RobotCommand) -> bool:
        return abs(utime - command.utime) <= 1e6 * self.options.expiry

    def _accept(self, utime: int, command: RobotCommand) -> None:
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
    """Refuse a control mode that a driver does not support.

    Args:
        mode: Control mode of the law.
        allowed: Control modes of the driver.
        driver: Its name, for the message.

    Raises:
        InputError: If it is not supported.
    """
    if mode not in allowed:
        names = ", ".join(str(m.name) for m in ControlMode if m in allowed and m)
        raise InputError(f"driver {driver}: takes no {mode.name}; allowed: {names}")
