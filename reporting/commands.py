"""What all commands share: exit status, errors of one line, Ctrl-C, and where a page is."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console
from rich.markup import escape

from pfsc_drake.errors import InputError, WriteError
from reporting.interruption import INTERRUPTED, raised_interruption
from reporting.terminal import one_line, print_error

if TYPE_CHECKING:
    from reporting.page import Report

WRONG_INPUT = 2
FAULT = 3
NOT_WRITTEN = 4


def run_app(app: typer.Typer, program: str, arguments: Sequence[str] | None = None) -> int:
    """Run a command line, and return its exit status.

    Args:
        app: Its commands.
        program: How it is called.
        arguments: Without the program's name; by default those of the process.
    """
    usage_error: Any = typer.BadParameter.__base__
    try:
        status = app(
            args=None if arguments is None else list(arguments),
            prog_name=program,
            standalone_mode=False,
        )
    except WriteError as error:
        print_error(f"error: {error}")
        return NOT_WRITTEN
    except InputError as error:
        return fail(str(error))
    except usage_error as error:
        reason = one_line(error.format_message()).rstrip(".")
        return fail(f"{reason}; see {program} --help")
    return status if isinstance(status, int) else 0


@contextmanager
def interruptible() -> Iterator[None]:
    """End the command with one line at Ctrl-C; up to here the process has just ended."""
    try:
        with raised_interruption():
            yield
    except KeyboardInterrupt:
        print_error("interrupted", after_echo=True)
        raise typer.Exit(INTERRUPTED) from None


def fail(message: str) -> int:
    """Report wrong input, and return the exit status."""
    print_error(f"error: {message}")
    return WRONG_INPUT


def show_page(what: str, report: "Report") -> int:
    """Say where a page is, or that it could not be written; return the exit status."""
    print_page(Console(), f"Open the {what}", report.path)
    if report.problem is None:
        return 0
    print_error(f"error: {report.problem}")
    return NOT_WRITTEN


def print_page(console: Console, invitation: str, page: Path | None) -> None:
    """Say where a page is, if there is one."""
    if page is not None:
        # Soft wrap: a path broken into two lines cannot be clicked.
        console.print(f"{invitation}: [bold cyan]{escape(str(page))}[/]", soft_wrap=True)
