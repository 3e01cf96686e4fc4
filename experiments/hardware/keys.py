"""Keys of a terminal while a robot is driven: slower, faster, pause, stop."""

import os
import select
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from pfsc_drake.drivers.remote_values import LARGEST_OVERRIDE, Pause, Request

KEYS = "space pauses and goes on, - and + change the speed, q stops the robot"
_STEP, _LEAST = 0.1, 0.1
_LONGEST = 64  # keys at once


class DriveKeys:
    """Makes requests of keys.

    Space is a pause, and once more the pace before it; ``-`` and ``+`` change the pace by 10 % of
    the planned one; ``q`` stops the robot. Other keys do nothing.
    """

    def __init__(self) -> None:
        self._pause = Pause()

    def requests(self, keys: str, override: float) -> list[Request]:
        """Return what keys ask for.

        Args:
            keys: Those that were pressed, the first one first.
            override: Share of the planned pace that is asked for so far.
        """
        asked = []
        for key in keys:
            if key == "q":
                asked.append(Request(stop=True))
                continue
            if key == " ":
                override = self._pause.toggled(override)
            elif key in "+-":
                step = _STEP if key == "+" else -_STEP
                override = min(max(round(override + step, 6), _LEAST), LARGEST_OVERRIDE)
            else:
                continue
            asked.append(Request(override))
        return asked


@contextmanager
def pressed_keys() -> Iterator[Callable[[], str]]:
    """Read keys as they are pressed, where the input is a terminal; elsewhere there are none.

    Yields:
        Returns the keys that were pressed since the last time, without waiting.
    """
    if not sys.stdin.isatty():
        yield lambda: ""
        return
    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)

    def read() -> str:
        if not select.select([descriptor], [], [], 0.0)[0]:
            return ""
        return os.read(descriptor, _LONGEST).decode("ascii", "ignore")

    try:
        tty.setcbreak(descriptor)
        yield read
    finally:
        with suppress(termios.error):  # of a terminal that has closed
            termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
