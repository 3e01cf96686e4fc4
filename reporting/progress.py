"""Progress of one or more runs on the terminal: a bar, or plain lines without a terminal."""

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
    """Returns a bar that is removed when it stops; its tasks have the field ``status``.

    Args:
        console: Console to write to.
        further: Columns behind the status.
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
    """Listener to the progress of a run."""

    def expect(self, duration: float) -> None:
        """Set the simulated time at the end [s], once it is known."""

    def __call__(self, simulated_time: float, phase: str) -> None:
        """Report the simulated time [s] and the phase, e.g. ``simulating``."""


class NoProgress:
    """Listener that ignores the progress."""

    def expect(self, duration: float) -> None:
        """Do nothing."""

    def __call__(self, simulated_time: float, phase: str) -> None:
        """Do nothing."""


class _Display:
    """A bar during an activity; nothing without a terminal."""

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
        simulated_time: Largest simulated time so far [s].
    """

    def __init__(
        self, console: Console, title: str, duration: float | None, *, paced: bool = True
    ) -> None:
        """Starts at zero.

        Args:
            console: Console to write to.
            title: Name of the run.
            duration: Simulated time at the end [s]; None if unknown.
            paced: Whether the time is simulated step by step, so that its rate is meaningful;
                otherwise it is the position of the work, and each phase begins anew.
        """
        super().__init__(console, title)
        self.simulated_time = self._time = 0.0  # the latter within a phase
        self._duration = duration
        self._paced = paced
        self._phase = ""
        self._phase_start = (time.monotonic(), 0.0)
        self._next_line = 0.0

    def __enter__(self) -> Self:
        self._show_bar(self._duration, TimeRemainingColumn())
        return self

    def expect(self, duration: float) -> None:
        """Set the simulated time at the end [s], once it is known."""
        self._duration = duration
        if self._bar is not None:
            self._bar.update(self._task, total=duration)

    def __call__(self, simulated_time: float, phase: str) -> None:
        """Show the progress of the run.

        Args:
            simulated_time: Simulated time [s].
            phase: Current phase, e.g. ``"simulating"``.
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
        """Phase, simulated time and, once time advances, real-time factor."""
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
    """Shows completed runs and their outcomes: a bar on a terminal, ten lines elsewhere."""

    def __init__(self, console: Console, title: str, total: int, done: int, usual: str) -> None:
        """Begin with the runs of earlier sessions.

        Args:
            console: Console to write to.
            title: Name of the series.
            total: Number of runs.
            done: Number of completed runs.
            usual: Outcome that is not mentioned.
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
        """Count the outcome of one run."""
        self._done += 1
        self._ends[status] += 1
        is_due = self._done - self._said >= self._total / PLAIN_LINES or self._done == self._total
        if self._bar is None and is_due:
            self._said = self._done
            self._say()
        self._show()

    def processes(self, number: int) -> None:
        """Set the number of running processes."""
        if not number and self._processes != number and self._bar is None:
            self._console.print(f"{self._title}: no worker is left; waiting for one")
        if not self._processes:
            # their start does not count as time of a run, nor do earlier runs
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
        """Completed runs with outcomes, and the time left."""
        parts = [f"{self._done} of {self._total} runs"]
        parts += [f"{n} {end}" for end, n in sorted(self._ends.items()) if end != self._usual]
        fresh = self._done - self._before
        if fresh > 0 and self._done < self._total:
            left = (time.monotonic() - self._begin) / fresh * (self._total - self._done)
            parts.append(f"{format_time(left)} left")
        elif not fresh and self._done < self._total:
            parts.append("starting" if not self._processes else f"{self._processes} at a time")
        return ", ".join(parts)


def format_time(seconds: float) -> str:
    """Returns a time in its two largest units, e.g. ``1 h 20 min``; seconds below a minute."""
    for i, (length, unit) in enumerate(_UNITS):
        if seconds >= length:
            whole, rest = divmod(seconds, length)
            smaller, name = _UNITS[i + 1] if i + 1 < len(_UNITS) else (1.0, "s")
            return f"{whole:.0f} {unit} {rest // smaller:.0f} {name}"
    return f"{seconds:.0f} s"


@contextmanager
def fraction_display(console: Console, title: str) -> Iterator[Callable[[float, str], None]]:
    """Return a function that shows a fraction and a phase.

    Args:
        console: Console to write to.
        title: Title of the display.
    """
    if not console.is_terminal:
        yield _plain(console, title)
        return
    with make_bar(console, TimeRemainingColumn()) as bar:
        task = bar.add_task(escape(title), total=1.0, status="")
        yield lambda fraction, phase: bar.update(task, completed=fraction, status=escape(phase))


def _plain(console: Console, title: str) -> Callable[[float, str], None]:
    last_words, reached = "", -1.0

    def show(fraction: float, phase: str) -> None:
        nonlocal last_words, reached
        words = phase.split(",", maxsplit=1)[0]
        if words != last_words or fraction >= reached + _PLAIN_STEP:
            last_words, reached = words, fraction
            console.print(f"{title}: {phase}, {fraction:.0%}", highlight=False, markup=False)

    return show
