"""Interruptions of a process: Ctrl-C, a request to end, a terminal that closes.

SIGINT, SIGTERM and SIGHUP have the same effect in every command: stop all motion, save the results
so far, print one line, exit with INTERRUPTED. A signal that was ignored when the process began
stays ignored, such as SIGHUP under ``nohup`` and SIGINT in the background of a script.
"""

import os
import signal
import stat
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

INTERRUPTED = 130  # exit status
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def leave_when_interrupted() -> None:
    """End the process with one line and INTERRUPTED at an interruption, until further notice."""
    for number in _signals():
        signal.signal(number, _leave)


@contextmanager
def raise_on_interruption() -> Iterator[None]:
    """Let an interruption raise KeyboardInterrupt; a library that swallows it only delays it."""
    handler = _Raise()
    with _handle(handler):
        yield


@contextmanager
def watch_interruption() -> Iterator[Callable[[], bool]]:
    """Return a function that reports whether there was an interruption since the context began.

    The first interruption is only recorded; a Ctrl-C after it raises KeyboardInterrupt. Signals of
    programs may come several times, as from ``timeout`` or a closing terminal, and are only
    recorded.

    If the program does not handle SIGTERM or SIGHUP itself, the signal is raised again at the end
    of the context, so that a script ends after the run that is saved.

    Raises:
        KeyboardInterrupt: If there was one before, and a library swallowed the exception.
    """
    noticed: list[signal.Signals] = []

    def notice(number: int, _frame: FrameType | None) -> None:
        _forget_closed_terminal()
        if noticed and number == signal.SIGINT:
            raise KeyboardInterrupt
        noticed.append(signal.Signals(number))

    before = {number: signal.getsignal(number) for number in _signals()}
    if any(isinstance(handler, _Raise) and handler.has_raised for handler in before.values()):
        raise KeyboardInterrupt
    with _handle(notice):
        yield lambda: bool(noticed)
    for number in dict.fromkeys(noticed):
        if before[number] is signal.SIG_DFL:
            signal.raise_signal(number)


@contextmanager
def _handle(handler: Callable[[int, FrameType | None], Any]) -> Iterator[None]:
    """Handle interruptions in a context."""
    before = {number: signal.signal(number, handler) for number in _signals()}
    try:
        yield
    finally:
        for number, former in before.items():
            signal.signal(number, former)


class _Raise:
    """Handler that raises KeyboardInterrupt and remembers it."""

    def __init__(self) -> None:
        self.has_raised = False

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        _forget_closed_terminal()
        self.has_raised = True
        raise KeyboardInterrupt


def _signals() -> list[signal.Signals]:
    """Return the signals that this thread handles and that are not ignored."""
    if threading.current_thread() is not threading.main_thread():
        return []
    return [number for number in SIGNALS if signal.getsignal(number) not in (signal.SIG_IGN, None)]


def _leave(_number: int, _frame: FrameType | None) -> None:
    newline = "\n" if sys.stderr.isatty() else ""  # after the ^C of the terminal
    with suppress(OSError):  # the terminal may be closed
        os.write(sys.stderr.fileno(), f"{newline}interrupted\n".encode())
    os._exit(INTERRUPTED)


def _forget_closed_terminal() -> None:
    """Discard output that a closed terminal can no longer show."""
    for descriptor in (1, 2):
        with suppress(OSError):
            is_device = stat.S_ISCHR(os.fstat(descriptor).st_mode)
            null = os.open(os.devnull, os.O_WRONLY)
            if is_device and not os.isatty(descriptor):
                os.dup2(null, descriptor)
            os.close(null)
