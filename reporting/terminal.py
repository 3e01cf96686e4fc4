"""Command lines and their output: options in groups, errors of one line, tables, exit status."""

import codecs
import dataclasses
import functools
import inspect
import io
import re
import sys
import unicodedata
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich.console import Console
from rich.markup import escape

from pfsc_drake.errors import InputError, WriteError
from reporting.interruption import INTERRUPTED, raise_on_interruption

if TYPE_CHECKING:
    from rich.console import Console

    from reporting.page import Report, Table

# characters of results without a plain decomposition
_PLAIN = {
    "≤": "<=",
    "≥": ">=",
    "·": "*",
    "\u2013": "-",
    "µ": "u",
    "⁻": "-",
    "…": "...",
    "\u2212": "-",
}
_POWER = re.compile("[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+")


def prepare_streams() -> None:
    """Lets stdout and stderr write any text on any terminal, in its own encoding.

    Characters outside the terminal's encoding are replaced by plain ones (``um`` for micrometres).
    """
    codecs.register_error("plain", _plain_characters)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="plain")


def silence_libraries() -> None:
    """Keeps warnings of Python's libraries off the terminal, unless they were requested.

    A run prints its own warnings, in lines of their own.
    """
    if not sys.warnoptions:
        warnings.simplefilter("ignore")


def print_error(line: str, after_echo: bool = False) -> None:
    """Writes one line to stderr, whatever the terminal's width.

    Args:
        line: Line to write.
        after_echo: Whether the terminal has just shown ^C.
    """
    newline = "\n" if after_echo and sys.stderr.isatty() else ""
    sys.stderr.write(f"{newline}{one_line(line)}\n")
    sys.stderr.flush()


def one_line(message: str) -> str:
    """Return a message without line breaks and other control characters."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(message.split()))


def _plain_characters(error: UnicodeError) -> tuple[str | bytes, int]:
    """Replace characters outside an encoding by ASCII; a handler of encoding errors."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    missing = error.object[error.start : error.end]
    if all("\udc80" <= character <= "\udcff" for character in missing):
        return missing.encode("utf-8", "surrogateescape"), error.end  # bytes of a file name
    missing = _POWER.sub(lambda power: "^" + power[0], missing)
    return "".join(map(_plain_character, missing)), error.end


def _plain_character(character: str) -> str:
    """Return ASCII for one character, ``?`` if there is none."""
    if character in _PLAIN:
        return _PLAIN[character]
    plain = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode("ascii")
    return plain or "?"


def print_table(console: "Console", table: "Table", most: int | None = None) -> None:
    """Print a table.

    Args:
        console: Console to print to.
        table: Table to print.
        most: Largest number of rows; None for all.
    """
    from rich.markup import escape
    from rich.table import Table as TerminalTable

    from reporting.metrics import format_cell

    shown = TerminalTable(title=table.title, title_justify="left", box=None, padding=(0, 2, 0, 0))
    numbers = {k for row in table.rows for k, cell in enumerate(row) if not isinstance(cell, str)}
    for k, name in enumerate(table.head):
        shown.add_column(name, justify="right" if k in numbers else "left")
    for row in table.rows[:most]:
        shown.add_row(*(escape(x) if isinstance(x, str) else format_cell(x) for x in row))
    console.print(shown)
    if most is not None and len(table.rows) > most:
        console.print(f"... {len(table.rows) - most} more on the page", style="dim")
    console.print()


WRONG_INPUT = 2
FAULT = 3
NOT_WRITTEN = 4


def flatten_options(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command whose groups are expanded into single options.

    Args:
        command: A function; each parameter that is a dataclass is a group.
    """
    groups: dict[str, type] = {}
    options: list[inspect.Parameter] = []
    for parameter in inspect.signature(command).parameters.values():
        kind = parameter.annotation
        if isinstance(kind, type) and dataclasses.is_dataclass(kind):
            groups[parameter.name] = kind
            options += inspect.signature(kind).parameters.values()
        else:
            options.append(parameter)

    @functools.wraps(command)
    def called(**values: Any) -> None:
        for name, group in groups.items():
            own = [field.name for field in dataclasses.fields(group)]
            values[name] = group(**{option: values.pop(option) for option in own})
        command(**values)

    # arguments first, in the displayed order
    options.sort(key=lambda option: option.default is not option.empty)
    flat = [option.replace(kind=option.KEYWORD_ONLY) for option in options]
    called.__signature__ = inspect.Signature(flat)  # type: ignore[attr-defined]
    called.__annotations__ = {option.name: option.annotation for option in flat}
    return called


def run_app(app: typer.Typer, program: str, arguments: Sequence[str] | None = None) -> int:
    """Run a command line, and return its exit status.

    Args:
        app: Application.
        program: Name of the program.
        arguments: Arguments without the program's name; by default those of the process.
    """
    usage_error: Any = typer.BadParameter.__base__
    try:
        _refuse_empty_out(sys.argv[1:] if arguments is None else arguments)
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


def _refuse_empty_out(arguments: Sequence[str]) -> None:
    """Refuse an empty folder name, which a path takes for the current folder."""
    for number, word in enumerate(arguments):
        if word == "--out=" or (word == "--out" and [*arguments[number + 1 : number + 2]] == [""]):
            raise InputError("--out '': no name of a folder; allowed: a folder, '.' for this one")


@contextmanager
def interruptible() -> Iterator[None]:
    """End the command with one line at Ctrl-C; before, the process would just have ended."""
    try:
        with raise_on_interruption():
            yield
    except KeyboardInterrupt:
        print_error("interrupted", after_echo=True)
        raise typer.Exit(INTERRUPTED) from None


def fail(message: str) -> int:
    """Report wrong input, and return the exit status."""
    print_error(f"error: {message}")
    return WRONG_INPUT


def show_page(what: str, report: "Report") -> int:
    """Print the path of a page, or that it could not be written; return the exit status."""
    print_page(Console(), f"Open the {what}", report.path)
    if report.problem is None:
        return 0
    print_error(f"error: {report.problem}")
    return NOT_WRITTEN


def print_page(console: Console, invitation: str, page: Path | None) -> None:
    """Print the path of a page, if there is one."""
    if page is not None:
        # soft wrap: a path broken into two lines cannot be clicked
        console.print(f"{invitation}: [bold cyan]{escape(str(page))}[/]", soft_wrap=True)
