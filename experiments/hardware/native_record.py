"""The record of a controller in C that drove a robot, and the same run repeated in Python."""

import enum
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pydrake.lcm import DrakeLcm

from experiments.hardware.check import FOREIGN, SILENCE
from experiments.hardware.drive import Drive, DrivenTick
from experiments.results.run_log import RunLog
from pfsc_drake.drivers.link import ControllerEnd
from pfsc_drake.drivers.messages import Dialect, RobotCommand
from pfsc_drake.drivers.remote_values import Request
from pfsc_drake.errors import InputError
from reporting.progress import ProgressListener

# reasons for which the last status was not answered
_REFUSED, _SILENCE, _UNANSWERED = "refused", "silence", ("clock", "not_finite")
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


@dataclass(frozen=True)
class NativeRun:
    """What a controller in C has left.

    Attributes:
        rows: Its record, see :class:`RecordFormat`.
        reason: Why it ended, in a word; None if it broke off.
        said: What else it said, one line each.
    """

    rows: np.ndarray
    reason: str | None
    said: list[str] = field(default_factory=list)


class RepeatedDrive:
    """A run of the loop in C, repeated by its description, status by status.

    Args:
        run: What the loop has left.
        make_drive: Makes its description, which has not begun.
        dialect: The robot's messages.
        progress: Told how far it is.

    Attributes:
        drive: What has repeated it, with the loop's record as its own.
        result: What came of it.
        first: Time of the first tick at which the two were not the same to the last bit [s], None
            if all were.
        ticks: How many were not.

    Raises:
        InputError: If there was no robot, or not the scenario's at rest at its start.
    """

    def __init__(
        self,
        run: NativeRun,
        make_drive: Callable[[ControllerEnd], Drive],
        dialect: Dialect,
        progress: ProgressListener,
    ) -> None:
        if not len(run.rows):
            raise InputError(f"no status of the robot for {1e3 * SILENCE:.0f} ms")
        end = _RepeatedEnd(DrakeLcm("memq://"), dialect)
        self.drive = drive = make_drive(end)
        # largest difference of what was sent at each tick, over the joints; zero where nothing was
        self._difference = list[float]()
        self.first: float | None = None
        self.ticks = 0
        held = np.zeros(run.rows.dtype["sent"].shape)
        for k, row in enumerate(run.rows):
            status = dialect.decode_status(row["message"][: row["size"]].tobytes())
            end.wrench = row["wrench"]
            drive.heed(Request(float(row["override"])))
            if k == 0:
                drive.begin(status)
                if run.reason == _REFUSED:
                    raise InputError("--native: the loop in C refused the robot, for no reason")
            stops = [why for event, why in STOPS.items() if row["event"] & event]
            if stops:
                drive.stop(stops[0])
            known = len(drive.ticks)
            drive.answer(status)
            made = drive.ticks[known:]
            if not made or np.isnan(made[-1].age):
                self._count(run.rows[k + (run.reason in _UNANSWERED) :])
                break
            self._compare(row, made)
            for tick in made[:-1]:
                tick.sent = held
            made[-1].age, made[-1].sent, made[-1].clipped = row["age"], row["sent"], row["clipped"]
            held = row["sent"]
            if k % 200 == 0:
                progress(drive.time, "repeating the run")
        if run.reason == _SILENCE:
            drive.lose(f"no status of the robot for {1e3 * SILENCE:.0f} ms")
        elif run.reason is None:
            drive.lose(run.said[-1])
        self.result = drive.result(float(run.rows[-1]["received"] - run.rows[0]["received"]))

    def _compare(self, row: np.void, made: Sequence[DrivenTick]) -> None:
        """Compare a row with the ticks that were missing, and that of its status."""
        largest = float(np.abs(made[-1].sent - row["sent"]).max())
        self._difference += [0.0] * (len(made) - 1) + [largest]
        told = (len(made) - 1, made[-1].clipped) == (row["missed"], row["clipped"])
        if not told or largest != 0.0:
            self._count([row])

    def _count(self, rows: Sequence[np.void] | np.ndarray) -> None:
        """Count rows that are not what the description does."""
        if len(rows):
            self.ticks += len(rows)
            self.first = rows[0]["tick"] * self.drive.period if self.first is None else self.first

    @property
    def warnings(self) -> list[str]:
        """What is to be said of the difference, one sentence each."""
        if self.first is None:
            return []
        return [
            f"the loop in C and its description differ at {self.ticks} ticks, first at t = "
            f"{self.first:.3f} s, by {max(self._difference, default=0.0):.3g} at most"
        ]

    def add_to(self, log: RunLog) -> None:
        """Add what happened on the link, and the difference of what was sent, to a run's log.

        Args:
            log: The log.
        """
        self.drive.add_to(log)
        noted = self._difference[: len(log.time)]
        log.add("sent_difference", [*noted, *[0.0] * (len(log.time) - len(noted))])


class _RepeatedEnd(ControllerEnd):
    """The end of a link that was: what is sent goes nowhere."""

    def send(self, command: RobotCommand) -> None:
        """Send nothing."""
