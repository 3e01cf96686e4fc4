"""How far a sweep is: runs done, how they ended, time left."""

import time
from collections import Counter
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.markup import escape
from rich.progress import Progress, TaskID

from experiments.sweep.worker import COMPLETED
from reporting.progress import PLAIN_LINES, make_bar

_UNITS = ((86400.0, "d"), (3600.0, "h"), (60.0, "min"))


class SweepProgress:
    """Shows a bar on a terminal, and ten lines elsewhere."""

    def __init__(self, console: Console, title: str, total: int, done: int) -> None:
        """Starts with what earlier sessions have done.

        Args:
            console: Where to write.
            title: Name of the sweep.
            total: Number of runs.
            done: Number of those that are there already.
        """
        self._console, self._title, self._total = console, title, total
        self._before = self._done = self._said = done
        self._processes = 0
        self._begin = time.monotonic()
        self._ends: Counter[str] = Counter()
        self._bar: Progress | None = None
        self._task = TaskID(0)

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._bar = make_bar(self._console)
            status = self._status()
            self._task = self._bar.add_task(
                escape(self._title), total=self._total, completed=self._done, status=status
            )
            self._bar.start()
        else:
            self._say()
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def advance(self, status: str) -> None:
        """Takes the end of one run, see :mod:`experiments.sweep.worker`."""
        self._done += 1
        self._ends[status] += 1
        is_due = self._done - self._said >= self._total / PLAIN_LINES or self._done == self._total
        if self._bar is None and is_due:
            self._said = self._done
            self._say()
        self._show()

    def processes(self, number: int) -> None:
        """Takes the number of processes that run."""
        if not number and self._processes != number and self._bar is None:
            self._console.print(f"{self._title}: no worker is left; waiting for one")
        if not self._processes:
            # starting them is no part of a run's time, nor are runs from before
            self._begin, self._before = time.monotonic(), self._done
        self._processes = number
        self._show()

    def _show(self) -> None:
        if self._bar is not None:
            self._bar.update(self._task, completed=self._done, status=self._status())

    def _say(self) -> None:
        self._console.print(
            f"{self._title}: {self._status()}", highlight=False, markup=False, soft_wrap=True
        )

    def _status(self) -> str:
        """Runs done and how, and the time left."""
        parts = [f"{self._done} of {self._total} runs"]
        parts += [f"{n} {end}" for end, n in sorted(self._ends.items()) if end != COMPLETED]
        fresh = self._done - self._before
        if fresh > 0 and self._done < self._total:
            left = (time.monotonic() - self._begin) / fresh * (self._total - self._done)
            parts.append(f"{spoken_time(left)} left")
        elif not fresh and self._done < self._total:
            parts.append("starting" if not self._processes else f"{self._processes} at a time")
        return ", ".join(parts)


def spoken_time(seconds: float) -> str:
    """Returns a time in its two largest units, e.g. ``1 h 20 min``; seconds below a minute."""
    for i, (length, unit) in enumerate(_UNITS):
        if seconds >= length:
            whole, rest = divmod(seconds, length)
            smaller, name = _UNITS[i + 1] if i + 1 < len(_UNITS) else (1.0, "s")
            return f"{whole:.0f} {unit} {rest // smaller:.0f} {name}"
    return f"{seconds:.0f} s"
