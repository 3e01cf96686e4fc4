"""The process of a controller in C that drives a robot, and what people ask it for."""

import selectors
import signal
import subprocess
from collections.abc import Callable
from contextlib import suppress

from experiments.hardware.native_project import NativeProject
from experiments.hardware.native_record import NativeRun
from pfsc_drake.drivers.layout import UdpmAddress
from pfsc_drake.drivers.link import RequestEnd
from pfsc_drake.drivers.remote_values import Request
from pfsc_drake.errors import InputError
from reporting.progress import ProgressListener

RECORD = "drive.bin"
_LOOKED_AT = 0.1  # s


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
