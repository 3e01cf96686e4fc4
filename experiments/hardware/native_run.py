"""Process of a controller in C that drives a robot, and requests to it."""

import selectors
import signal
import subprocess
from collections.abc import Callable
from contextlib import suppress

from experiments.hardware.native_project import NativeProject
from experiments.hardware.native_record import NativeRun
from pfsc_drake.drivers.layout import UdpmAddress
from pfsc_drake.drivers.link import RequestEndpoint
from pfsc_drake.drivers.remote_values import Request
from pfsc_drake.errors import InputError
from reporting.progress import ProgressListener

RECORD = "drive.bin"
_LOOKED_AT = 0.1  # s


class Operator:
    """Requests of the operator to the loop in C, by keys and messages, and progress reports.

    Args:
        end: Receiver of request messages.
        keys: Returns requests by keys since the last call, given the override.
        override: Initial speed scaling of the reference.
        fastest: Largest speed scaling.
    """

    def __init__(
        self,
        end: RequestEndpoint,
        keys: Callable[[float], list[Request]],
        override: float,
        fastest: float,
    ) -> None:
        self._end, self._keys, self.override, self._fastest = end, keys, override, fastest
        self._is_stopping = False

    def lines(self) -> str:
        """Return the requests as input lines of the loop."""
        self._end.listen()
        text = ""
        for request in [*self._end.requests(), *self._keys(self.override)]:
            if request.override is not None:
                self.override = min(request.override, self._fastest)
                text += f"o {self.override!r}\n"
            if request.stop:
                self._is_stopping = True
                text += "s\n"
        return text

    def tell(self, time: float) -> None:
        """Send the progress for monitoring.

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
        self._end.publish_progress(0, values)


def run_native(
    project: NativeProject,
    address: UdpmAddress,
    duration: float,
    interrupted: Callable[[], bool],
    progress: ProgressListener,
    operator: Operator,
) -> NativeRun:
    """Run a compiled controller until it ends.

    Args:
        project: The controller.
        address: The robot's bus.
        duration: Duration in the time of the planned motion [s].
        interrupted: Whether to stop.
        progress: Progress listener.
        operator: Source of requests.

    Raises:
        InputError: If it did not start.
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
            messages = _watch(loop, interrupted, progress, operator)
        except BaseException:
            loop.kill()  # the robot's driver damps
            raise
    reason = (
        messages.pop().removeprefix("end ")
        if messages and messages[-1].startswith("end ")
        else None
    )
    if reason is None:
        messages.append(f"the loop in C ended abnormally with status {loop.returncode}")
    if not record.is_file():
        raise InputError(f"--native: {'; '.join(messages)}")
    return NativeRun(project.record.read(record), reason, messages)


def _watch(
    loop: subprocess.Popen[bytes],
    interrupted: Callable[[], bool],
    progress: ProgressListener,
    operator: Operator,
) -> list[str]:
    """Return the loop's messages other than progress."""
    assert loop.stdout is not None
    assert loop.stdin is not None
    is_interrupted, left = False, b""
    messages: list[str] = []
    with selectors.DefaultSelector() as selector:
        selector.register(loop.stdout, selectors.EVENT_READ)
        while True:
            if interrupted() and not is_interrupted:
                is_interrupted = True
                loop.send_signal(signal.SIGTERM)
            requests = operator.lines()
            if requests:
                with suppress(BrokenPipeError):
                    loop.stdin.write(requests.encode())
            if not selector.select(_LOOKED_AT):
                continue
            data = loop.stdout.read(4096)
            if not data:
                return messages
            *lines, left = (left + data).split(b"\n")
            for line in map(bytes.decode, lines):
                if line.startswith("t "):
                    progress(float(line[2:]), f"driving at {operator.override:.0%}")
                    operator.tell(float(line[2:]))
                else:
                    messages.append(line)
