"""Results in a notebook: short tables, recordings in frames, progress."""

import sys
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from types import TracebackType
from typing import Any, Self
from urllib.parse import quote

from reporting.metrics import Metric
from reporting.page import fill

_SHOWN = 8  # metrics of a short table
_PARTS = 200  # of the whole, between two updates of the progress


def in_notebook() -> bool:
    """Return whether a Jupyter kernel runs this, which shows more than text."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return type(shell).__name__ == "ZMQInteractiveShell"


def show_html(content: str) -> None:
    """Show HTML below the running cell.

    Args:
        content: The HTML.
    """
    from IPython.display import display

    display(_bundle(content), raw=True)


def page_frame(page: Path, height: int, title: str) -> str:
    """Return a frame that shows a page, as HTML.

    A page below the current folder stays a file, which the frame loads when it becomes visible;
    another one, which a notebook could not reach, is embedded in the frame.

    Args:
        page: The page, self-contained.
        height: Height of the frame [pixels].
        title: Title of the frame.
    """
    here, file = Path.cwd().resolve(), page.resolve()
    if file.is_relative_to(here):
        source = f'src="{quote(file.relative_to(here).as_posix())}"'
    else:
        source = f'srcdoc="{escape(file.read_text(encoding="utf-8"))}"'
    return (
        f'<iframe {source} title="{escape(title)}" loading="lazy" allowfullscreen '
        f'style="width: 100%; height: {height}px; border: 0"></iframe>'
    )


def short_table(
    title: str, ends: Sequence[str], warnings: Sequence[str], metrics: Mapping[str, Metric]
) -> str:
    """Return the essentials of a run as HTML: outcome, metrics, warnings.

    Args:
        title: Name of the run.
        ends: Reasons why it did not end well, one phrase each; none if it did.
        warnings: Warnings, one sentence each.
        metrics: All metrics; those with a target are shown, or the first few; others are folded.
    """
    targeted = [name for name, metric in metrics.items() if metric.target is not None]
    chosen = (targeted or list(metrics))[:_SHOWN]
    return fill(
        "notebook.html",
        title=title,
        ends=ends,
        warnings=warnings,
        metrics={name: metrics[name] for name in chosen},
        folded={name: metric for name, metric in metrics.items() if name not in chosen},
    )


def metrics_table(metrics: Mapping[str, Metric], names: Sequence[str] | None = None) -> str:
    """Return metrics with their targets, as HTML.

    Args:
        metrics: The metrics.
        names: Names of the metrics to show; by default all.
    """
    shown = {name: metrics[name] for name in (metrics if names is None else names)}
    return fill("notebook.html", title=None, metrics=shown, folded={})


class NotebookProgress:
    """Shows the progress of a run in one line below its cell, which is removed at the end."""

    def __init__(self, title: str) -> None:
        """Begin at zero.

        Args:
            title: Name of the run.
        """
        self._title = title
        self._duration: float | None = None
        self._shown: tuple[str, int] | None = None
        self._line: Any = None

    def __enter__(self) -> Self:
        from IPython.display import display

        self._line = display(_bundle(""), raw=True, display_id=True)
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        self._show("")

    def expect(self, duration: float) -> None:
        """Set the simulated time at the end [s], once it is known."""
        self._duration = duration

    def __call__(self, simulated_time: float, phase: str) -> None:
        """Show simulated time and phase, if the display changes.

        Args:
            simulated_time: Simulated time [s].
            phase: Current phase.
        """
        share = simulated_time / self._duration if self._duration else 0.0
        shown = phase, int(_PARTS * share)
        if shown == self._shown:
            return
        self._shown = shown
        time = f", t = {simulated_time:.2f} s" if simulated_time else ""
        bar = f'<progress value="{share:.3f}"></progress>' if self._duration else ""
        self._show(f"{bar} {escape(self._title)}: {escape(phase)}{time}")

    def _show(self, content: str) -> None:
        self._line.update(_bundle(content), raw=True)


def _bundle(content: str) -> dict[str, str]:
    """Return HTML in the kernel's format; its text form is empty."""
    return {"text/html": content, "text/plain": ""}
