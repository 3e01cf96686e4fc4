"""Progress of a run, or of many, on the terminal: a bar, or plain lines where there is none."""

import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Protocol, Self

from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)

PLAIN_LINES = 10  # plain lines per run of known length
ROUNDING = 1e-9  # relative
_PLAIN_STEP = 0.1  # of the whole, between plain lines of one phase
_UNITS = ((86400.0, "d"), (3600.0, "h"), (60.0, "min"))


def make_bar(console: Console, *further: ProgressColumn) -> Progress:
    """Returns a bar that is gone when it stops; its tasks have the field ``status``.

    Args:
        console: Where to write.
        further: What is behind the status.
    """
    return Progress(
        SpinnerColumn("dots" if console.encoding.startswith("utf") else "line"),
        TextColumn("[bold]{task.description}"),
        BarColumn(bar_width=None),
        TextColumn("{task.fields[status]}"),
        *further,
        console=console,
        transient=True,
    )


class ProgressListener(Protocol):
    """Who wants to know how far a run is."""

    def expect(self, duration: float) -> None:
        """Told the simulated time at the end [s], once it is known."""

    def __call__(self, simulated_time: float, phase: str) -> None:
        """Told the simulated time [s] and what goes on, e.g. ``simulating``."""


class NoProgress:
    """Tells nobody how far a run is."""

    def expect(self, duration: float) -> None:
        """Tell nothing."""

    def __call__(self, simulated_time: float, phase: str) -> None:
        """Tell nothing."""


class _Display:
    """A bar while something is under way; none where there is no terminal."""

    def __init__(self, console: Console, title: str) -> None:
        self._console, self._title = console, title
        self._bar: Progress | None = None
        self._task = TaskID(0)

    def _show_bar(
        self, total: float | None, *further: ProgressColumn, completed: int = 0, status: str = ""
    ) -> bool:
        """Start the bar, and return whether there is one."""
        if self._console.is_terminal:
            self._bar = make_bar(self._console, *further)
            self._task = self._bar.add_task(
                escape(self._title), total=total, completed=completed, status=status
            )
            self._bar.start()
        return self._bar is not None

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            self._bar.stop()


class ProgressDisplay(_Display):
    """Shows simulated time, real-time factor and remaining time; call it with each advance.

    Attributes:
        simulated_time: s, the largest so far.
    """

    def __init__(
        self, console: Console, title: str, duration: float | None, *, paced: bool = True
    ) -> None:
        """Starts at zero.

        Args:
            console: Where to write.
            title: Name of the run.
            duration: s, simulated time at the end; None if unknown.
            paced: Whether the time is simulated step by step, so that its pace tells something;
                else it is where the work is, and each phase begins anew.
        """
        super().__init__(console, title)
        self.simulated_time = self._time = 0.0  # the latter where the phase is
        self._duration = duration
        self._paced = paced
        self._phase = ""
        self._phase_start = (time.monotonic(), 0.0)
        self._next_line = 0.0

    def __enter__(self) -> Self:
        self._show_bar(self._duration, TimeRemainingColumn())
        return self

    def expect(self, duration: float) -> None:
        """Takes the simulated time at the end [s], once it is known."""
        self._duration = duration
        if self._bar is not None:
            self._bar.update(self._task, total=duration)

    def __call__(self, simulated_time: float, phase: str) -> None:
        """Shows how far the run is.

        Args:
            simulated_time: s.
            phase: What goes on, e.g. ``"simulating"``.
        """
        new_phase = phase != self._phase
        if new_phase:
            self._phase = phase
            self._phase_start = (time.monotonic(), simulated_time)
        if new_phase and not self._paced:
            self.simulated_time = 0.0
        if new_phase and (not self._paced or simulated_time < self.simulated_time):
            self._next_line = 0.0
        self._time = simulated_time
        self.simulated_time = max(self.simulated_time, simulated_time)
        if self._bar is not None:
            self._bar.update(self._task, completed=self.simulated_time, status=self._status())
        elif new_phase or simulated_time >= self._next_line * (1.0 - ROUNDING):
            self._console.print(f"{self._title}: {self._status()}", highlight=False, markup=False)
            step = self._duration / PLAIN_LINES if self._duration else 1.0
            # Times are sums of steps; rounding must not repeat a line.
            self._next_line = (simulated_time / step + ROUNDING) // 1.0 * step + step

    def _status(self) -> str:
        """Phase, simulated time and, once time advances, how much faster than real time."""
        wall = time.monotonic() - self._phase_start[0]
        advanced = self._time - self._phase_start[1]
        if advanced <= 0.0 or wall <= 0.0:
            return self._phase
        total = f" of {self._duration:.2f}" if self._duration else ""
        if not self._paced:
            return f"{self._phase}, t = {self._time:.2f}{total} s"
        factor = advanced / wall
        return f"{self._phase} {self._time:.2f}{total} s, {factor:.1f} x real time"


class CountDisplay(_Display):
    """Shows how many runs are done and how they ended: a bar on a terminal, ten lines elsewhere."""

    def __init__(self, console: Console, title: str, total: int, done: int, usual: str) -> None:
        """Starts with what earlier sessions have done.

        Args:
            console: Where to write.
            title: Name of it all.
            total: Number of runs.
            done: Number of those that are there already.
            usual: The end that needs no word.
        """
        super().__init__(console, title)
        self._total, self._usual = total, usual
        self._before = self._done = self._said = done
        self._processes = 0
        self._begin = time.monotonic()
        self._ends: Counter[str] = Counter()

    def __enter__(self) -> Self:
        if not self._show_bar(self._total, completed=self._done, status=self._status()):
            self._say()
        return self

    def advance(self, status: str) -> None:
        """Takes the end of one run."""
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
        parts += [f"{n} {end}" for end, n in sorted(self._ends.items()) if end != self._usual]
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


@contextmanager
def fraction_display(console: Console, title: str) -> Iterator[Callable[[float, str], None]]:
    """Give a function that shows the fraction done and what is done.

    Args:
        console: Where to write.
        title: What it is all about.
    """
    if not console.is_terminal:
        yield _plain(console, title)
        return
    with make_bar(console, TimeRemainingColumn()) as bar:
        task = bar.add_task(escape(title), total=1.0, status="")
        yield lambda fraction, phase: bar.update(task, completed=fraction, status=escape(phase))


def _plain(console: Console, title: str) -> Callable[[float, str], None]:
    said, reached = "", -1.0

    def tell(fraction: float, phase: str) -> None:
        nonlocal said, reached
        words = phase.split(",", maxsplit=1)[0]
        if words != said or fraction >= reached + _PLAIN_STEP:
            said, reached = words, fraction
            console.print(f"{title}: {phase}, {fraction:.0%}", highlight=False, markup=False)

    return tell
