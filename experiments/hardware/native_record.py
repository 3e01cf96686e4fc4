"""The record of a controller in C that drives a robot: what came, and what it was answered with."""

import enum
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.hardware.check import FOREIGN
from pfsc_drake.errors import InputError

_MAGIC = b"PFSCDRV1"
_HEAD = struct.Struct("=8sII")
_WORD = 8  # bytes


class Event(enum.IntFlag):
    """What happened before a status was answered."""

    NONE = 0
    INTERRUPTED = 1
    ALONE = 2
    UNRECORDED = 4
    ASKED = 8
    FOREIGN = 16


# why the controller stops then
STOPS = {
    Event.INTERRUPTED: "interrupted",
    Event.ALONE: "who started the controller is gone",
    Event.UNRECORDED: "its record could not be written",
    Event.ASKED: "asked to stop",
    Event.FOREIGN: FOREIGN,
}


@dataclass(frozen=True)
class RecordFormat:
    """How a record of N joints is written: a head, then one row for each status.

    Attributes:
        joints: Number N of joints.
        message_size: Bytes of a status.
    """

    joints: int
    message_size: int

    @property
    def room(self) -> int:
        """Bytes that a row has for its status."""
        return -(-self.message_size // _WORD) * _WORD

    @property
    def row(self) -> np.dtype:
        """One row, as ``drive_record`` of ``recorder.h``.

        ``tick`` is its number; ``received`` [s] when its status came, since the loop began, and
        ``age`` [s] how long it took to answer it; ``override`` what share of the planned pace was
        asked for; ``event`` is an :class:`Event`; ``message`` the
        status as it came.
        """
        return np.dtype(
            [
                ("tick", np.int64),
                ("received", np.float64),
                ("age", np.float64),
                ("override", np.float64),
                ("wrench", np.float64, 6),
                ("sent", np.float64, self.joints),
                ("missed", np.int32),
                ("clipped", np.int32),
                ("robot_mode", np.int32),
                ("fault", np.int32),
                ("event", np.int32),
                ("size", np.int32),
                ("message", np.uint8, self.room),
            ]
        )

    def read(self, file: Path) -> np.ndarray:
        """Return the rows of a file; one that is not whole is left out.

        Args:
            file: The file.

        Raises:
            InputError: If it is no such record.
        """
        data = file.read_bytes()
        if data[: _HEAD.size] != self._head:
            raise InputError(f"{file}: no record of a robot with {self.joints} such joints")
        count = (len(data) - _HEAD.size) // self.row.itemsize
        return np.frombuffer(data, self.row, count, _HEAD.size)

    def write(self, file: Path, rows: np.ndarray) -> None:
        """Write rows into a file.

        Args:
            file: The file.
            rows: The rows.
        """
        file.write_bytes(self._head + rows.astype(self.row).tobytes())

    @property
    def _head(self) -> bytes:
        return _HEAD.pack(_MAGIC, self.row.itemsize, self.joints)
