"""Progress of what knows the fraction done: a bar, or plain lines where there is no terminal."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.markup import escape
from rich.progress import TimeRemainingColumn

from reporting.progress import make_bar

_PLAIN_STEP = 0.1  # of the whole, between plain lines of one phase


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
