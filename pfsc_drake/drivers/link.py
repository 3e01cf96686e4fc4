"""Endpoints of the link between a robot and its controller."""

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

# a queue hands over some of the received messages; more rounds follow while there are more
_MOST_ROUNDS = 100
# recent commands, to recognize them when they come back from the bus
_RECENT = 1000
# errors of decoding other messages, which count as lost
_UNREADABLE = (ValueError, AttributeError, IndexError, struct.error)


class _Endpoint:
    """An endpoint of the link, which stores the newest message."""

    def __init__(self, lcm: DrakeLcmInterface, dialect: Dialect) -> None:
        self.lcm, self.dialect = lcm, dialect
        self._data: bytes | None = None

    def leave(self) -> None:
        """Leave the bus: later messages are not received, and cost no time."""
        del self.lcm

    def _listen(self, channel: str) -> None:
        self.lcm.Subscribe(channel, self._store)

    def _store(self, data: bytes) -> None:
        self._data = data

    def _drain(self) -> None:
        for _ in range(_MOST_ROUNDS):
            if not self.lcm.HandleSubscriptions(0):
                return


class RequestEndpoint:
    """Endpoint that receives requests of operators and pages, and publishes progress.

    Args:
        lcm: The bus.
    """

    def __init__(self, lcm: DrakeLcmInterface) -> None:
        self.lcm = lcm
        self._requests: list[Request] = []
        lcm.Subscribe(REQUEST_CHANNEL, self._store_request)

    def listen(self) -> None:
        """Receive all waiting messages, without blocking."""
        while self.lcm.HandleSubscriptions(0):
            pass

    def requests(self) -> list[Request]:
        """Return the requests since the last call, the oldest first."""
        requests, self._requests = self._requests, []
        return requests

    def publish_progress(self, utime: int, values: Mapping[str, float]) -> None:
        """Publish the progress.

        Args:
            utime: The robot's clock [us].
            values: Numbers by name.
        """
        self.lcm.Publish(PROGRESS_CHANNEL, encode_values(utime, values))

    def _store_request(self, data: bytes) -> None:
        with suppress(*_UNREADABLE):
            self._requests.append(Request.of(decode_values(data)))


class ControllerEndpoint(_Endpoint, RequestEndpoint):
    """The controller's endpoint: it receives status and requests, and sends commands.

    Args:
        lcm: The bus.
        dialect: The robot's messages.

    Attributes:
        wrench: Last measurement of the force sensor, shape (6,) [N, Nm], or None.
        foreign: Number of received commands of other senders.
    """

    def __init__(self, lcm: DrakeLcmInterface, dialect: Dialect) -> None:
        _Endpoint.__init__(self, lcm, dialect)
        RequestEndpoint.__init__(self, lcm)
        self.wrench: np.ndarray | None = None
        self.foreign, self._sent = 0, dict[bytes, None]()
        self._listen(dialect.status_channel)
        lcm.Subscribe(dialect.command_channel, self._compare)
        lcm.Subscribe(FORCE_TORQUE_CHANNEL, self._store_wrench)

    def receive(self, timeout: float) -> RobotStatus | None:
        """Return the newest status that has not been returned, or None if none comes in time.

        Args:
            timeout: Longest time to wait [s].
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
        """Count a command on the bus that was not sent from here."""
        self.foreign += bytes(data) not in self._sent

    def _store_wrench(self, data: bytes) -> None:
        with suppress(*_UNREADABLE):
            self.wrench = decode_wrench(data)


class ObserverEndpoint(_Endpoint):
    """An observer's endpoint: it receives status and progress, and sends requests.

    Args:
        lcm: The bus.
        dialect: The robot's messages.

    Attributes:
        progress: Last progress of the controller, by name; empty before the first.
        progress_time: Time of its reception, by ``time.monotonic`` [s].
    """

    def __init__(self, lcm: DrakeLcmInterface, dialect: Dialect) -> None:
        super().__init__(lcm, dialect)
        self.progress: dict[str, float] = {}
        self.progress_time = -math.inf
        self._listen(dialect.status_channel)
        lcm.Subscribe(PROGRESS_CHANNEL, self._store_progress)

    def receive(self, timeout: float) -> RobotStatus | None:
        """Return the newest status after waiting, None if none has come since the last call.

        Args:
            timeout: Time to wait for messages [s].
        """
        self.lcm.HandleSubscriptions(round(1e3 * timeout))
        self._drain()
        data, self._data = self._data, None
        with suppress(*_UNREADABLE):
            return None if data is None else self.dialect.decode_status(data)
        return None

    def send_request(self, request: Request) -> None:
        """Send a request to the controller.

        Args:
            request: The request.
        """
        self.lcm.Publish(REQUEST_CHANNEL, encode_values(0, request.values()))

    def _store_progress(self, data: bytes) -> None:
        with suppress(*_UNREADABLE):
            self.progress, self.progress_time = decode_values(data), time.monotonic()


class RobotEndpoint(_Endpoint):
    """The robot's endpoint: it sends status and receives commands.

    Args:
        lcm: The bus.
        dialect: The robot's messages.
    """

    def __init__(self, lcm: DrakeLcmInterface, dialect: Dialect) -> None:
        super().__init__(lcm, dialect)
        self._listen(dialect.command_channel)

    def send_status(self, status: RobotStatus, wrench: np.ndarray | None = None) -> None:
        """Send a status, and before it the measurement of a force sensor, if there is one.

        Args:
            status: The status.
            wrench: Force and torque on the sensor, its axes, shape (6,) [N, Nm].
        """
        if wrench is not None:
            self.lcm.Publish(FORCE_TORQUE_CHANNEL, encode_wrench(status.utime, wrench))
        self.lcm.Publish(self.dialect.status_channel, self.dialect.encode_status(status))

    def receive_command(self) -> RobotCommand | None:
        """Return the newest command that has not been returned, None if there is none."""
        self._drain()
        if self._data is None:
            return None
        data, self._data = self._data, None
        with suppress(*_UNREADABLE):
            return self.dialect.decode_command(data)
        return None
