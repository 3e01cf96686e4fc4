"""Terminal keys during a driven run: slower, faster, pause, stop."""

import os
import select
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from pfsc_drake.drivers.remote_values import LARGEST_OVERRIDE, Pause, Request

KEYS = "space: pause and resume, - and +: speed, q: stop the robot"
_STEP, _LEAST = 0.1, 0.1
_LONGEST = 64  # keys per read


class DriveKeys:
    """Translation of keys to requests.

    Space pauses and resumes; ``-`` and ``+`` change the speed scaling by 10 %; ``q`` stops the
    robot. Other keys are ignored.
    """

    def __init__(self) -> None:
        self._pause = Pause()

    def requests(self, keys: str, override: float) -> list[Request]:
        """Return the requests of pressed keys.

        Args:
            keys: Pressed keys, the first one first.
            override: Current requested speed scaling.
        """
        requests = []
        for key in keys:
            if key == "q":
                requests.append(Request(stop=True))
                continue
            if key == " ":
                override = self._pause.toggle(override)
            elif key in "+-":
                step = _STEP if key == "+" else -_STEP
                override = min(max(round(override + step, 6), _LEAST), LARGEST_OVERRIDE)
            else:
                continue
            requests.append(Request(override))
        return requests


@contextmanager
def pressed_keys() -> Iterator[Callable[[], str]]:
    """Read keys from a terminal without waiting; without a terminal there are none.

    The context provides a function that returns the keys pressed since its last call.
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
        with suppress(termios.error):  # of a closed terminal
            termios.tcsetattr(descriptor, termios.TCSADRAIN, before)
