"""Both ends of the link between a robot and its controller."""

import time
from contextlib import suppress

import numpy as np
from pydrake.lcm import DrakeLcmInterface

from pfsc_drake.drivers.messages import (
    FORCE_TORQUE_CHANNEL,
    Dialect,
    RobotCommand,
    RobotStatus,
    decode_wrench,
    encode_wrench,
)

# a queue hands over some of what has come; more rounds are made while there is more
_MOST_ROUNDS = 100
# what decoding something else raises; it is as good as lost
_UNREADABLE = (ValueError, AttributeError, IndexError)


class _End:
    """One end of the link: it keeps the newest message, as it came."""

    def __init__(self, lcm: DrakeLcmInterface, dialect: Dialect) -> None:
        self.lcm, self.dialect = lcm, dialect
        self._data: bytes | None = None

    def leave(self) -> None:
        """Leave the bus: what comes from now on is not heard, and costs no time."""
        del self.lcm

    def _listen(self, channel: str) -> None:
        self.lcm.Subscribe(channel, self._keep)

    def _keep(self, data: bytes) -> None:
        self._data = data

    def _drain(self) -> None:
        for _ in range(_MOST_ROUNDS):
            if not self.lcm.HandleSubscriptions(0):
                return


class ControllerEnd(_End):
    """The controller's end: it hears the robot's status and sends commands.

    Args:
        lcm: The bus.
        dialect: The robot's messages.

    Attributes:
        wrench: What the force sensor told last, shape (6,) [N, Nm], or None.
    """

    def __init__(self, lcm: DrakeLcmInterface, dialect: Dialect) -> None:
        super().__init__(lcm, dialect)
        self.wrench: np.ndarray | None = None
        self._listen(dialect.status_channel)
        lcm.Subscribe(FORCE_TORQUE_CHANNEL, self._keep_wrench)

    def receive(self, timeout: float) -> RobotStatus | None:
        """Return the newest status that has not been returned, or None if none comes in time.

        Args:
            timeout: How long to wait [s].
        """
        end = time.monotonic() + timeout
        while True:
            self._drain()
            if self._data is not None:
                data, self._data = self._data, None
                with suppress(*_UNREADABLE):
                    return self.dialect.decode_status(data)
            left = end - time.monotonic()
            if left <= 0.0:
                return None
            self.lcm.HandleSubscriptions(max(1, min(int(1e3 * left), 10)))

    def send(self, command: RobotCommand) -> None:
        """Send a command.

        Args:
            command: The command.
        """
        self.lcm.Publish(self.dialect.command_channel, self.dialect.encode_command(command))

    def _keep_wrench(self, data: bytes) -> None:
        with suppress(ValueError):
            self.wrench = decode_wrench(data)


class RobotEnd(_End):
    """The robot's end: it tells its status and hears commands.

    Args:
        lcm: The bus.
        dialect: The robot's messages.
    """

    def __init__(self, lcm: DrakeLcmInterface, dialect: Dialect) -> None:
        super().__init__(lcm, dialect)
        self._listen(dialect.command_channel)

    def tell(self, status: RobotStatus, wrench: np.ndarray | None = None) -> None:
        """Send a status, and before it what a force sensor measures, if there is one.

        Args:
            status: The status.
            wrench: Force and torque on the sensor, its axes, shape (6,) [N, Nm].
        """
        if wrench is not None:
            self.lcm.Publish(FORCE_TORQUE_CHANNEL, encode_wrench(status.utime, wrench))
        self.lcm.Publish(self.dialect.status_channel, self.dialect.encode_status(status))

    def hear(self) -> RobotCommand | None:
        """Return the newest command that has not been returned, None if there is none."""
        self._drain()
        if self._data is None:
            return None
        data, self._data = self._data, None
        with suppress(*_UNREADABLE):
            return self.dialect.decode_command(data)
        return None
