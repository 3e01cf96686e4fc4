"""Ctrl-C: leaves at once while nothing is lost by it, and ends a run in good order.

It comes as an exception while the program works, is only noticed while a run is worth keeping, and
ends the process on the spot while that is starting: libraries that are just being imported make
errors of their own of an exception.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

INTERRUPTED = 130  # exit status


def leave_when_interrupted() -> None:
    """Ends the process with one line and INTERRUPTED at Ctrl-C, until told otherwise."""
    if _is_obeyed():
        signal.signal(signal.SIGINT, _leave)


@contextmanager
def raised_interruption() -> Iterator[None]:
    """Lets Ctrl-C raise KeyboardInterrupt; a library that swallows it only delays it."""
    if not _is_obeyed():
        yield
        return
    before = signal.signal(signal.SIGINT, _Raise())
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def noticed_interruption(*also: signal.Signals) -> Iterator[Callable[[], bool]]:
    """Gives a function that tells whether Ctrl-C was pressed since the context began.

    The first Ctrl-C is only noticed; the next one raises KeyboardInterrupt.

    Args:
        also: Signals that count as one, such as that of a terminal that closes.

    Raises:
        KeyboardInterrupt: If Ctrl-C was pressed before, and a library swallowed the exception.
    """
    noticed = False

    def notice(_number: int, _frame: FrameType | None) -> None:
        nonlocal noticed
        if noticed:
            raise KeyboardInterrupt
        noticed = True

    if not _is_obeyed():
        yield lambda: False
        return
    before = signal.getsignal(signal.SIGINT)
    if isinstance(before, _Raise) and before.has_raised:
        raise KeyboardInterrupt
    others = {number: signal.signal(number, notice) for number in also}
    signal.signal(signal.SIGINT, notice)
    try:
        yield lambda: noticed
    finally:
        for number, handler in ({signal.SIGINT: before} | others).items():
            signal.signal(number, handler)


class _Raise:
    """Handler that raises KeyboardInterrupt and remembers it."""

    def __init__(self) -> None:
        self.has_raised = False

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        self.has_raised = True
        raise KeyboardInterrupt


def _is_obeyed() -> bool:
    """Whether Ctrl-C is this thread's business: jobs in the background may ignore it."""
    in_main_thread = threading.current_thread() is threading.main_thread()
    return in_main_thread and signal.getsignal(signal.SIGINT) not in (signal.SIG_IGN, None)


def _leave(_number: int, _frame: FrameType | None) -> None:
    newline = "\n" if sys.stderr.isatty() else ""  # after the ^C of the terminal
    os.write(sys.stderr.fileno(), f"{newline}interrupted\n".encode())
    os._exit(INTERRUPTED)
