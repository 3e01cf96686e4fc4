"""Both ends of the link between a robot and its controller."""

import math
import struct
import time
from collections.abc import Mapping
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
from pfsc_drake.drivers.remote_values import (
    PROGRESS_CHANNEL,
    REQUEST_CHANNEL,
    Request,
    decode_values,
    encode_values,
)

# a queue hands over some of what has come; more rounds are made while there is more
_MOST_ROUNDS = 100
# commands that are told from those of others, as they come back from the bus
_RECENT = 1000
# what decoding something else raises; it is as good as lost
_UNREADABLE = (ValueError, AttributeError, IndexError, struct.error)


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


class RequestEnd:
    """The end of whom people and pages ask for something, and who tells them how far it is.

    Args:
        lcm: The bus.
    """

    def __init__(self, lcm: DrakeLcmInterface) -> None:
        self.lcm = lcm
        self._requests: list[Request] = []
        lcm.Subscribe(REQUEST_CHANNEL, self._keep_request)

    def listen(self) -> None:
        """Hear what has come, without waiting."""
        while self.lcm.HandleSubscriptions(0):
            pass

    def requests(self) -> list[Request]:
        """Return what has been asked for since the last time, the oldest first."""
        asked, self._requests = self._requests, []
        return asked

    def tell(self, utime: int, values: Mapping[str, float]) -> None:
        """Tell whoever watches how far it is.

        Args:
            utime: The robot's clock [us].
            values: Numbers by name.
        """
        self.lcm.Publish(PROGRESS_CHANNEL, encode_values(utime, values))

    def _keep_request(self, data: bytes) -> None:
        with suppress(*_UNREADABLE):
            self._requests.append(Request.of(decode_values(data)))


class ControllerEnd(_End, RequestEnd):
    """The controller's end: it hears the robot's status and requests, and sends commands.

    Args:
        lcm: The bus.
        dialect: The robot's messages.

    Attributes:
        wrench: What the force sensor told last, shape (6,) [N, Nm], or None.
        foreign: Number of commands of other senders that were heard.
    """

    def __init__(self, lcm: DrakeLcmInterface, dialect: Dialect) -> None:
        _End.__init__(self, lcm, dialect)
        RequestEnd.__init__(self, lcm)
        self.wrench: np.ndarray | None = None
        self.foreign, self._sent = 0, dict[bytes, None]()
        self._listen(dialect.status_channel)
        lcm.Subscribe(dialect.command_channel, self._compare)
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
        data = self.dialect.encode_command(command)
        self._sent[data] = None
        if len(self._sent) > _RECENT:
            del self._sent[next(iter(self._sent))]
        self.lcm.Publish(self.dialect.command_channel, data)

    def _compare(self, data: bytes) -> None:
        """Count a command on the bus that is none of those sent from here."""
        self.foreign += bytes(data) not in self._sent

    def _keep_wrench(self, data: bytes) -> None:
        with suppress(*_UNREADABLE):
            self.wrench = decode_wrench(data)


class WatchingEnd(_End):
    """The end of who looks on: it hears status and progress, and asks the controller.

    Args:
        lcm: The bus.
        dialect: The robot's messages.

    Attributes:
        progress: What the controller told last, by name; empty before it has told anything.
        told: When that was, by ``time.monotonic`` [s].
    """

    def __init__(self, lcm: DrakeLcmInterface, dialect: Dialect) -> None:
        super().__init__(lcm, dialect)
        self.progress: dict[str, float] = {}
        self.told = -math.inf
        self._listen(dialect.status_channel)
        lcm.Subscribe(PROGRESS_CHANNEL, self._keep_progress)

    def look(self, timeout: float) -> RobotStatus | None:
        """Return the newest status after waiting, None if none has come since the last look.

        Args:
            timeout: How long to wait for messages [s].
        """
        self.lcm.HandleSubscriptions(round(1e3 * timeout))
        self._drain()
        data, self._data = self._data, None
        with suppress(*_UNREADABLE):
            return None if data is None else self.dialect.decode_status(data)
        return None

    def ask(self, request: Request) -> None:
        """Ask the controller for something.

        Args:
            request: What.
        """
        self.lcm.Publish(REQUEST_CHANNEL, encode_values(0, request.values()))

    def _keep_progress(self, data: bytes) -> None:
        with suppress(*_UNREADABLE):
            self.progress, self.told = decode_values(data), time.monotonic()


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
