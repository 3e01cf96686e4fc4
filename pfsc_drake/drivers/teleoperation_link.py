"""Endpoint of a link between a leader and a follower in two processes, over LCM."""

import math
import struct
import time
from collections.abc import Callable
from contextlib import suppress

import numpy as np
from pydrake.lcm import DrakeLcmInterface

from pfsc_drake.control.teleoperation.message import FIELDS, MESSAGE
from pfsc_drake.drivers.remote_values import decode_values, encode_values

SIDES = ("leader", "follower")
# errors of decoding other messages, which count as lost
_UNREADABLE = (ValueError, AttributeError, IndexError, KeyError, struct.error)
_MOST_ROUNDS = 100
_SESSION = "session"
_NAMES = [
    f"{name}_{k}" if part.stop - part.start > 1 else name
    for name, part in FIELDS.items()
    for k in range(part.stop - part.start)
]
# fields that are sums since the other side began
_SUMS = [*range(*FIELDS["signal"].indices(MESSAGE)), FIELDS["energy"].start]


def channel_of(side: str) -> str:
    """Return the LCM channel of a side's messages.

    Args:
        side: ``leader`` or ``follower``.
    """
    return f"PFSC_TELEOPERATION_{side.upper()}"


class TeleoperationEndpoint:
    """Sends a side's messages, and stores the newest of the other side.

    Either side may begin first: the sums of the other side count from its first message, or from
    its restart, so that no device jumps to the other's position. A message counts as lost if it is
    older than the last one, contains NaN or infinity, or reduces the energy.

    Args:
        lcm: The bus.
        side: Side of this endpoint.
        patience: Longest silence of the other side before it is lost [s].
        clock: Clock [s].

    Attributes:
        lcm: The bus.
        patience: See above.
        received: Number of accepted messages.
    """

    def __init__(
        self,
        lcm: DrakeLcmInterface,
        side: str,
        patience: float = math.inf,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.lcm, self._channel = lcm, channel_of(side)
        self.patience, self._clock = patience, clock
        (other,) = set(SIDES) - {side}
        self._queue: list[bytes] = []
        self._newest, self._base = np.zeros(MESSAGE), np.zeros(MESSAGE)
        self._session: float | None = None
        self.received, self._last = 0, 0.0
        self.begin()
        lcm.Subscribe(channel_of(other), self._queue.append)

    def begin(self) -> None:
        """Restart: sums of later messages count from zero."""
        self._own_session = float(time.time_ns() // 1000)
        self._newest[:], self._session = 0.0, None

    @property
    def is_lost(self) -> bool:
        """Whether the other side has been silent for too long after its first message."""
        return self.received > 0 and self._clock() - self._last > self.patience

    def send(self, message: np.ndarray) -> None:
        """Send a message.

        Args:
            message: Shape (8,), see :data:`FIELDS`.
        """
        values = {_SESSION: self._own_session} | dict(zip(_NAMES, message.tolist(), strict=True))
        self.lcm.Publish(self._channel, encode_values(int(message[0]), values))

    def newest(self) -> np.ndarray:
        """Return the newest accepted message, shape (8,); zero if there is none."""
        for _ in range(_MOST_ROUNDS):
            if not self.lcm.HandleSubscriptions(0):
                break
        waiting, self._queue[:] = list(self._queue), []
        for data in waiting:
            with suppress(*_UNREADABLE):
                self._accept(decode_values(data))
        return self._newest.copy()

    def _accept(self, values: dict[str, float]) -> None:
        session = values[_SESSION]
        message = np.array([values[name] for name in _NAMES])
        if not math.isfinite(session) or not np.isfinite(message).all():
            return
        if session != self._session:
            if self._session is not None and session < self._session:
                return
            self._session = session
            self._base[:] = 0.0
            self._base[_SUMS] = message[_SUMS] - self._newest[_SUMS]
        elif message[0] <= self._newest[0]:
            return
        message -= self._base
        energy = FIELDS["energy"]
        if message[energy] < self._newest[energy]:
            return
        self._newest[:] = message
        self.received += 1
        self._last = self._clock()
