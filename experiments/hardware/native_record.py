"""Record of a controller in C that drove a robot, and repetition of the run in Python."""

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
from pfsc_drake.drivers.link import ControllerEndpoint
from pfsc_drake.drivers.messages import Dialect, RobotCommand
from pfsc_drake.drivers.remote_values import Request
from pfsc_drake.errors import InputError
from reporting.progress import ProgressListener

# reasons for an unanswered last status
_REFUSED, _SILENCE, _UNANSWERED = "refused", "silence", ("clock", "not_finite")
_MAGIC = b"PFSCDRV1"
_HEAD = struct.Struct("=8sII")
_WORD = 8  # bytes


class Event(enum.IntFlag):
    """Events before the answer to a status."""

    NONE = 0
    INTERRUPTED = 1
    ALONE = 2
    UNRECORDED = 4
    REQUESTED = 8
    FOREIGN = 16


# reasons of the controller's stop
STOPS = {
    Event.INTERRUPTED: "interrupted",
    Event.ALONE: "the controller's parent process has ended",
    Event.UNRECORDED: "its record could not be written",
    Event.REQUESTED: "stop requested",
    Event.FOREIGN: FOREIGN,
}


@dataclass(frozen=True)
class RecordFormat:
    """Format of a record of N joints: a head, then one row for each status.

    Attributes:
        joints: Number N of joints.
        message_size: Bytes of a status.
    """

    joints: int
    message_size: int

    @property
    def capacity(self) -> int:
        """Bytes of a row for its status."""
        return -(-self.message_size // _WORD) * _WORD

    @property
    def row(self) -> np.dtype:
        """One row, as ``drive_record`` of ``recorder.h``.

        ``tick`` is its number; ``received`` [s] the arrival of its status since the beginning of
        the loop; ``age`` [s] the time to its answer; ``override`` the requested speed scaling;
        ``event`` an :class:`Event`; ``message`` the received status.
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
                ("message", np.uint8, self.capacity),
            ]
        )

    def read(self, file: Path) -> np.ndarray:
        """Return the complete rows of a file.

        Args:
            file: The file.

        Raises:
            InputError: If it is not such a record.
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
    """Result of a controller in C.

    Attributes:
        rows: Its record, see :class:`RecordFormat`.
        reason: Reason of its end, one word; None after an abnormal end.
        messages: Its other messages, one line each.
    """

    rows: np.ndarray
    reason: str | None
    messages: list[str] = field(default_factory=list)


class RepeatedDrive:
    """Repetition of a run of the loop in C by its Python description, status by status.

    Args:
        run: Result of the loop.
        make_drive: Returns a new Python description.
        dialect: The robot's messages.
        progress: Progress listener.

    Attributes:
        drive: The description after the repetition, with the loop's record.
        result: Result of the run.
        first: Time of the first tick that is not bit-identical [s], None if all are identical.
        ticks: Number of ticks that are not bit-identical.

    Raises:
        InputError: If there was no robot, or not the scenario's at rest at its start.
    """

    def __init__(
        self,
        run: NativeRun,
        make_drive: Callable[[ControllerEndpoint], Drive],
        dialect: Dialect,
        progress: ProgressListener,
    ) -> None:
        if not len(run.rows):
            raise InputError(f"no status of the robot for {1e3 * SILENCE:.0f} ms")
        end = _RepeatedEnd(DrakeLcm("memq://"), dialect)
        self.drive = drive = make_drive(end)
        # largest difference of the commands at each tick, over the joints; zero without command
        self._difference = list[float]()
        self.first: float | None = None
        self.ticks = 0
        last = np.zeros(run.rows.dtype["sent"].shape)
        for k, row in enumerate(run.rows):
            status = dialect.decode_status(row["message"][: row["size"]].tobytes())
            end.wrench = row["wrench"]
            drive.handle_request(Request(float(row["override"])))
            if k == 0:
                drive.begin(status)
                if run.reason == _REFUSED:
                    raise InputError("--native: the loop in C rejected the robot without reason")
            stops = [why for event, why in STOPS.items() if row["event"] & event]
            if stops:
                drive.stop(stops[0])
            known = len(drive.ticks)
            drive.answer(status)
            added = drive.ticks[known:]
            if not added or np.isnan(added[-1].age):
                self._count(run.rows[k + (run.reason in _UNANSWERED) :])
                break
            self._compare(row, added)
            for tick in added[:-1]:
                tick.sent = last
            added[-1].age, added[-1].sent, added[-1].clipped = (
                row["age"],
                row["sent"],
                row["clipped"],
            )
            last = row["sent"]
            if k % 200 == 0:
                progress(drive.time, "repeating the run")
        if run.reason == _SILENCE:
            drive.lose(f"no status of the robot for {1e3 * SILENCE:.0f} ms")
        elif run.reason is None:
            drive.lose(run.messages[-1])
        self.result = drive.result(float(run.rows[-1]["received"] - run.rows[0]["received"]))

    def _compare(self, row: np.void, added: Sequence[DrivenTick]) -> None:
        """Compare a row with the missed ticks and the tick of its status."""
        largest = float(np.abs(added[-1].sent - row["sent"]).max())
        self._difference += [0.0] * (len(added) - 1) + [largest]
        agrees = (len(added) - 1, added[-1].clipped) == (row["missed"], row["clipped"])
        if not agrees or largest != 0.0:
            self._count([row])

    def _count(self, rows: Sequence[np.void] | np.ndarray) -> None:
        """Count rows that differ from the description."""
        if len(rows):
            self.ticks += len(rows)
            self.first = rows[0]["tick"] * self.drive.period if self.first is None else self.first

    @property
    def warnings(self) -> list[str]:
        """Warnings about differences, one sentence each."""
        if self.first is None:
            return []
        return [
            f"the loop in C and its description differ at {self.ticks} ticks, first at t = "
            f"{self.first:.3f} s, by {max(self._difference, default=0.0):.3g} at most"
        ]

    def add_to(self, log: RunLog) -> None:
        """Add signals of the link, and the difference of commands, to a run's log.

        Args:
            log: The log.
        """
        self.drive.add_to(log)
        noted = self._difference[: len(log.time)]
        log.add("sent_difference", [*noted, *[0.0] * (len(log.time) - len(noted))])


class _RepeatedEnd(ControllerEndpoint):
    """Link end of a repetition, which sends nothing."""

    def send(self, command: RobotCommand) -> None:
        """Send nothing."""
