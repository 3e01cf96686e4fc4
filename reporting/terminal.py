"""What is written on the terminal: streams that take any text, errors of one line, tables."""

import codecs
import io
import re
import sys
import unicodedata
import warnings
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from reporting.page import Table


# characters of results that no decomposition makes plain
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
    """Lets stdout and stderr write any text on any terminal, in its own characters.

    What the terminal's encoding lacks is written in plain characters (``um`` for micrometres).
    """
    codecs.register_error("plain", _plain_characters)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="plain")


def silence_libraries() -> None:
    """Keeps warnings of Python's libraries off the terminal, unless they were asked for.

    What matters to the user of a run is said by the run itself, in a line of its own.
    """
    if not sys.warnoptions:
        warnings.simplefilter("ignore")


def print_error(line: str, after_echo: bool = False) -> None:
    """Writes one line to stderr, whatever the terminal's width.

    Args:
        line: To write.
        after_echo: Whether a terminal stands behind the ^C that it has just shown.
    """
    newline = "\n" if after_echo and sys.stderr.isatty() else ""
    sys.stderr.write(f"{newline}{one_line(line)}\n")
    sys.stderr.flush()


def one_line(message: str) -> str:
    """Returns a message without line breaks and whatever else a terminal would obey."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(message.split()))


def _plain_characters(error: UnicodeError) -> tuple[str | bytes, int]:
    """Writes in ASCII what an encoding lacks; a handler of encoding errors."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    missing = error.object[error.start : error.end]
    if all("\udc80" <= character <= "\udcff" for character in missing):
        return missing.encode("utf-8", "surrogateescape"), error.end  # the bytes of a file's name
    missing = _POWER.sub(lambda power: "^" + power[0], missing)
    return "".join(map(_plain_character, missing)), error.end


def _plain_character(character: str) -> str:
    """ASCII for one character, ``?`` where there is none."""
    if character in _PLAIN:
        return _PLAIN[character]
    plain = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode("ascii")
    return plain or "?"


def print_table(console: "Console", table: "Table", most: int | None = None) -> None:
    """Print a table.

    Args:
        console: Where.
        table: Which.
        most: Rows to print at most; None for all.
    """
    from rich.markup import escape
    from rich.table import Table as TerminalTable

    shown = TerminalTable(title=table.title, title_justify="left", box=None, padding=(0, 2, 0, 0))
    numbers = {k for row in table.rows for k, cell in enumerate(row) if not isinstance(cell, str)}
    for k, name in enumerate(table.head):
        shown.add_column(name, justify="right" if k in numbers else "left")
    for row in table.rows[:most]:
        shown.add_row(*(escape(x) if isinstance(x, str) else f"{x:.4g}" for x in row))
    console.print(shown)
    if most is not None and len(table.rows) > most:
        console.print(f"... {len(table.rows) - most} more on the page", style="dim")
    console.print()
