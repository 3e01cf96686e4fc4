"""A robot driven by the controller in C, and the same run repeated by its description here."""

import selectors
import signal
import subprocess
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from pydrake.lcm import DrakeLcm

from experiments.hardware.drive import Drive
from experiments.hardware.drive_options import DriveOptions
from experiments.hardware.drive_record import DrivenTick
from experiments.hardware.native_project import NativeProject
from experiments.hardware.native_record import STOPS
from experiments.results.run_log import RunLog
from experiments.simulation import SimulationResult
from pfsc_drake.drivers.link import ControllerEnd, RequestEnd
from pfsc_drake.drivers.messages import Dialect, RobotCommand
from pfsc_drake.drivers.remote_values import Request
from pfsc_drake.drivers.udpm import UdpmAddress
from pfsc_drake.errors import InputError
from reporting.progress import ProgressListener

RECORD = "drive.bin"
_LOOKED_AT = 0.1  # s
_REFUSED, _SILENCE = "refused", "silence"
# reasons for which the last status was not answered
_UNANSWERED = ("clock", "not_finite")


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


class Operator:
    """Tells the loop in C what people ask for, by keys and by messages, and them how far it is.

    Args:
        end: Where messages come from.
        keys: Returns what was asked for by keys since the last time, given the override.
        override: Share of the planned pace at which the reference moves at first.
        fastest: Largest share of it.
    """

    def __init__(
        self,
        end: RequestEnd,
        keys: Callable[[float], list[Request]],
        override: float,
        fastest: float,
    ) -> None:
        self._end, self._keys, self.override, self._fastest = end, keys, override, fastest
        self._is_stopping = False

    def lines(self) -> str:
        """Return what the loop is to be told, line by line."""
        self._end.listen()
        told = ""
        for request in [*self._end.requests(), *self._keys(self.override)]:
            if request.override is not None:
                self.override = min(request.override, self._fastest)
                told += f"o {self.override!r}\n"
            if request.stop:
                self._is_stopping = True
                told += "s\n"
        return told

    def tell(self, time: float) -> None:
        """Tell who watches how far it is.

        Args:
            time: Time since the first status [s].
        """
        values = {
            "time": time,
            "override": self.override,
            "stopping": float(self._is_stopping),
            "ended": 0.0,
            "missed": 0.0,
        }
        self._end.tell(0, values)


def run_native(
    project: NativeProject,
    address: UdpmAddress,
    duration: float,
    interrupted: Callable[[], bool],
    progress: ProgressListener,
    operator: Operator,
) -> NativeRun:
    """Let a compiled controller drive a robot until it ends.

    Args:
        project: The controller.
        address: The robot's bus.
        duration: How long, in the time of the motion as planned [s].
        interrupted: Whether it is to stop.
        progress: Told how far it is.
        operator: What people ask for.

    Raises:
        InputError: If it did not begin.
    """
    record = project.folder / RECORD
    record.unlink(missing_ok=True)
    bus = [address.address, str(address.port), str(address.ttl)]
    words = [*bus, repr(duration), str(record.resolve()), repr(operator.override)]
    # its standard input is open for as long as this process is there, and a terminal interrupts
    # this process alone, which says then what the loop is to do
    with subprocess.Popen(
        [str(project.program.resolve()), *words],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        bufsize=0,
        process_group=0,
    ) as loop:
        try:
            said = _watch(loop, interrupted, progress, operator)
        except BaseException:
            loop.kill()  # the robot's driver damps
            raise
    reason = said.pop().removeprefix("end ") if said and said[-1].startswith("end ") else None
    if reason is None:
        said.append(f"the loop in C broke off with status {loop.returncode}")
    if not record.is_file():
        raise InputError(f"--native: {'; '.join(said)}")
    return NativeRun(project.record.read(record), reason, said)


def _watch(
    loop: subprocess.Popen[bytes],
    interrupted: Callable[[], bool],
    progress: ProgressListener,
    operator: Operator,
) -> list[str]:
    """Return what the loop has said beside how far it is."""
    assert loop.stdout is not None
    assert loop.stdin is not None
    told, left = False, b""
    said: list[str] = []
    with selectors.DefaultSelector() as selector:
        selector.register(loop.stdout, selectors.EVENT_READ)
        while True:
            if interrupted() and not told:
                told = True
                loop.send_signal(signal.SIGTERM)
            asked = operator.lines()
            if asked:
                with suppress(BrokenPipeError):
                    loop.stdin.write(asked.encode())
            if not selector.select(_LOOKED_AT):
                continue
            data = loop.stdout.read(4096)
            if not data:
                return said
            *lines, left = (left + data).split(b"\n")
            for line in map(bytes.decode, lines):
                if line.startswith("t "):
                    progress(float(line[2:]), f"driving at {operator.override:.0%}")
                    operator.tell(float(line[2:]))
                else:
                    said.append(line)


@dataclass
class NativeComparison:
    """What the loop in C did, beside what its description would have done.

    Attributes:
        difference: Of each tick, largest difference of what was sent, over the joints [Nm or N,
            rad/s or m/s]; zero where nothing was.
        first: Time of the first that was not the same to the last bit [s], None if all were.
        ticks: How many were not.
    """

    difference: list[float] = field(default_factory=list)
    first: float | None = None
    ticks: int = 0

    def note(self, row: np.void, ticks: Sequence[DrivenTick], period: float) -> None:
        """Note a status that was answered.

        Args:
            row: What the loop did.
            ticks: What its description did: the ticks that were missing, and that of the status.
            period: Sampling time [s].
        """
        tick = ticks[-1]
        largest = float(np.abs(tick.sent - row["sent"]).max())
        self.difference += [0.0] * (len(ticks) - 1) + [largest]
        told = (len(ticks) - 1, tick.clipped) == (row["missed"], row["clipped"])
        if not told or largest != 0.0:
            self.ticks += 1
            self.first = row["tick"] * period if self.first is None else self.first

    def note_rest(self, rows: np.ndarray, period: float) -> None:
        """Note statuses that the description has not answered.

        Args:
            rows: What the loop did.
            period: Sampling time [s].
        """
        if len(rows):
            self.ticks += len(rows)
            self.first = rows[0]["tick"] * period if self.first is None else self.first

    @property
    def warnings(self) -> list[str]:
        """What is to be said of it, one sentence each."""
        if self.first is None:
            return []
        return [
            f"the loop in C and its description differ at {self.ticks} ticks, first at t = "
            f"{self.first:.3f} s, by {max(self.difference, default=0.0):.3g} at most"
        ]

    def add_to(self, log: RunLog) -> None:
        """Add the difference to the log of a run.

        Args:
            log: The log.
        """
        noted = self.difference[: len(log.time)]
        log.add("sent_difference", [*noted, *[0.0] * (len(log.time) - len(noted))])


class _RepeatedEnd(ControllerEnd):
    """The end of a link that was: what is sent goes nowhere."""

    def __init__(self, dialect: Dialect) -> None:
        super().__init__(DrakeLcm("memq://"), dialect)

    def send(self, command: RobotCommand) -> None:
        """Send nothing."""


@dataclass(frozen=True)
class RepeatedDrive:
    """A run of the loop in C, repeated by its description.

    Attributes:
        drive: What has repeated it, with the loop's record as its own.
        comparison: Of both.
        result: What came of it.
    """

    drive: Drive
    comparison: NativeComparison
    result: SimulationResult

    def add_to(self, log: RunLog) -> None:
        """Add what happened on the link to the log of a run.

        Args:
            log: The log.
        """
        self.drive.record.add_to(log)
        self.comparison.add_to(log)


def repeat_drive(
    run: NativeRun,
    make_drive: Callable[[ControllerEnd], Drive],
    dialect: Dialect,
    options: DriveOptions,
    progress: ProgressListener,
) -> RepeatedDrive:
    """Repeat what the loop in C did, status by status, and compare.

    Args:
        run: What it has left.
        make_drive: Makes its description, which has not begun.
        dialect: The robot's messages.
        options: What it allowed itself.
        progress: Told how far it is.

    Raises:
        InputError: If there was no robot, or not the scenario's at rest at its start.
    """
    if not len(run.rows):
        raise InputError(f"no status of the robot for {1e3 * options.silence:.0f} ms")
    end, comparison = _RepeatedEnd(dialect), NativeComparison()
    drive = make_drive(end)
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
        known = len(drive.record.ticks)
        drive.answer(status)
        made = drive.record.ticks[known:]
        if not made or np.isnan(made[-1].age):
            expected = run.reason in _UNANSWERED
            comparison.note_rest(run.rows[k + expected :], drive.period)
            break
        comparison.note(row, made, drive.period)
        for tick in made[:-1]:
            tick.sent = held
        made[-1].age, made[-1].sent, made[-1].clipped = row["age"], row["sent"], row["clipped"]
        held = row["sent"]
        if k % 200 == 0:
            progress(drive.time, "repeating the run")
    if run.reason == _SILENCE:
        drive.lose(f"no status of the robot for {1e3 * options.silence:.0f} ms")
    elif run.reason is None:
        drive.lose(run.said[-1])
    wall = float(run.rows[-1]["received"] - run.rows[0]["received"])
    return RepeatedDrive(drive, comparison, drive.result(wall))
