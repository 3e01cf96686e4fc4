"""One end of a link between a leader and a follower in two processes, over LCM."""

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
# what decoding something else raises; it is as good as lost
_UNREADABLE = (ValueError, AttributeError, IndexError, KeyError, struct.error)
_MOST_ROUNDS = 100
_SESSION = "session"
_NAMES = [
    f"{name}_{k}" if part.stop - part.start > 1 else name
    for name, part in FIELDS.items()
    for k in range(part.stop - part.start)
]
# sums since the other side began
_SUMS = [*range(*FIELDS["signal"].indices(MESSAGE)), FIELDS["energy"].start]


def channel_of(side: str) -> str:
    """Return the LCM channel on which a side tells.

    Args:
        side: ``leader`` or ``follower``.
    """
    return f"PFSC_TELEOPERATION_{side.upper()}"


class TeleoperationEnd:
    """Sends a side's messages, and keeps the newest of the other side.

    Whichever side begins first: what the other one had summed up when it was first heard, or when
    it began anew, counts as nothing, so that nobody jumps to where the other one is. What is
    older than the last message, no number, or takes energy back, is as good as lost.

    Args:
        lcm: The bus.
        side: Whose end it is.
        patience: How long the other side may be silent until it is lost [s].
        clock: Tells the time [s].

    Attributes:
        lcm: The bus.
        patience: See above.
        received: Messages that were believed.
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
        self._heard, self._base = np.zeros(MESSAGE), np.zeros(MESSAGE)
        self._session: float | None = None
        self.received, self._last = 0, 0.0
        self.begin()
        lcm.Subscribe(channel_of(other), self._queue.append)

    def begin(self) -> None:
        """Begin anew: what is told from now on sums up from zero."""
        self._own_session = float(time.time_ns() // 1000)
        self._heard[:], self._session = 0.0, None

    @property
    def is_lost(self) -> bool:
        """Whether the other side was there, and has been silent for too long."""
        return self.received > 0 and self._clock() - self._last > self.patience

    def send(self, message: np.ndarray) -> None:
        """Send a message.

        Args:
            message: Shape (8,), see :data:`FIELDS`.
        """
        values = {_SESSION: self._own_session} | dict(zip(_NAMES, message.tolist(), strict=True))
        self.lcm.Publish(self._channel, encode_values(int(message[0]), values))

    def newest(self) -> np.ndarray:
        """Return the newest message that has come, shape (8,); zero if none has."""
        for _ in range(_MOST_ROUNDS):
            if not self.lcm.HandleSubscriptions(0):
                break
        waiting, self._queue[:] = list(self._queue), []
        for data in waiting:
            with suppress(*_UNREADABLE):
                self._hear(decode_values(data))
        return self._heard.copy()

    def _hear(self, values: dict[str, float]) -> None:
        session = values[_SESSION]
        told = np.array([values[name] for name in _NAMES])
        if not math.isfinite(session) or not np.isfinite(told).all():
            return
        if session != self._session:
            if self._session is not None and session < self._session:
                return
            self._session = session
            self._base[:] = 0.0
            self._base[_SUMS] = told[_SUMS] - self._heard[_SUMS]
        elif told[0] <= self._heard[0]:
            return
        told -= self._base
        energy = FIELDS["energy"]
        if told[energy] < self._heard[energy]:
            return
        self._heard[:] = told
        self.received += 1
        self._last = self._clock()
