"""CSV files: columns of numbers under a line of names."""

import re
import stat
from collections.abc import Callable, Iterator
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np

from pfsc_drake.checks import NUMBER
from pfsc_drake.errors import InputError, in_one_line, nearest_file, shortened, suggestion
from pfsc_drake.geometry.progress import Progress

_MAX_BYTES = 1 << 28
_KINDS = {
    stat.S_IFDIR: "Is a directory",
    stat.S_IFIFO: "is a FIFO",
    stat.S_IFCHR: "is a device",
    stat.S_IFBLK: "is a device",
    stat.S_IFSOCK: "is a socket",
}


def read_regular_file(name: str | FilePath, kind: str) -> bytes:
    """Return what a file holds.

    Args:
        name: Name of a regular file of at most 256 MiB.
        kind: What it should be, for messages, as "CSV".

    Raises:
        InputError: It cannot be read, is not regular or too large.
    """
    try:
        status = FilePath(name).stat()
        if not stat.S_ISREG(status.st_mode):
            raise OSError(0, _KINDS.get(stat.S_IFMT(status.st_mode), "is no regular file"))
        if status.st_size > _MAX_BYTES:
            raise OSError(0, f"{status.st_size >> 20} MiB, at most {_MAX_BYTES >> 20} are read")
        return FilePath(name).read_bytes()
    # ValueError: a name that no file can have.
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None)
        if isinstance(error, FileNotFoundError):
            reason = f"{reason}{nearest_file(FilePath(name))}"
        raise unreadable(name, kind, reason) from error


def unreadable(name: str | FilePath, kind: str, reason: str | None = None) -> InputError:
    """Return the error that refuses a file, by default because it is not text."""
    what = reason or "not a text file"
    return InputError(f"{shortened(str(name), 1000)}: {what}; a readable {kind} file is required")


MAX_ROWS = 1_000_000
_ROWS_PER_REPORT = 50_000
_LARGEST = 1e12


class NumberTable(NamedTuple):
    """Columns of numbers.

    Attributes:
        lines: Where in the file the rows stand, [n].
        header: Names of the columns, [m].
        rows: [n, m].
    """

    lines: list[int]
    header: list[str]
    rows: np.ndarray


def read_numbers(
    name: str,
    what: str,
    check_header: Callable[[str, list[str]], None],
    progress: Progress | None = None,
) -> NumberTable:
    """Read a CSV file.

    The first line that is neither empty nor a comment (#) names the columns.

    Args:
        name: Name of a regular file of at most 256 MiB and 1,000,000 rows.
        what: What rows are, for messages, as "waypoints".
        check_header: Refuses names of columns; told where they stand and the names.
        progress: Told the fraction read and what is done.

    Raises:
        InputError: The file cannot be read or is too large, has no rows or rows of different
            lengths, or a value is not a number.
    """
    header: list[str] = []
    lines: list[int] = []
    rows: list[list[float]] = []
    for line, content, fraction in _contents(name):
        cells = [cell.strip() for cell in content.split(",")]
        if not header:
            header = cells
            check_header(f"{name}, line {line}", header)
            continue
        if len(cells) != len(header):
            raise InputError(
                f"{name}, line {line}: {len(cells)} values; {len(header)} are required"
            )
        rows.append([_number(name, line, *item) for item in zip(header, cells, strict=True)])
        lines.append(line)
        if len(rows) > MAX_ROWS:
            raise InputError(
                f"{name}: more than {MAX_ROWS} {what}; so many are the most that are read"
            )
        if progress is not None and len(rows) % _ROWS_PER_REPORT == 0:
            progress(fraction, f"reading the {what}")
    if not rows:
        raise InputError(f"{name}: no {what}; a line with column names and data are required")
    return NumberTable(lines, header, np.array(rows))


def read_columns(name: str, what: str, columns: list[str]) -> tuple[list[int], np.ndarray]:
    """Read a CSV file that must have certain columns, in any order, and no others.

    Args:
        name: Name of the file.
        what: What rows are, for messages.
        columns: Names of the columns.

    Returns:
        Where in the file the rows stand, [n], and the columns in the order asked for, [n, columns].

    Raises:
        InputError: As :func:`read_numbers`, or columns are unknown, there twice or missing.
    """
    table = read_numbers(
        name, what, lambda place, header: check_columns(place, header, columns, columns)
    )
    return table.lines, table.rows[:, [table.header.index(label) for label in columns]]


def check_columns(place: str, header: list[str], known: list[str], required: list[str]) -> None:
    """Refuse columns that are unknown, there twice, or missing.

    Args:
        place: File and line, for messages.
        header: Names of columns.
        known: Names that are allowed.
        required: Names that must be there.

    Raises:
        InputError: If a column is unknown, there twice, or missing.
    """
    problems = []
    for label in dict.fromkeys(header):
        if label not in known:
            hint = suggestion(label, known)
            if re.search("[;\t]", label):
                hint = "; separate columns by commas"
            if NUMBER.fullmatch(label):
                hint = "; the first line names the columns"
            allowed = f"{', '.join(known)}{hint}"
            problems.append(f"column '{quote(label)}' is unknown; allowed: {allowed}")
            if NUMBER.fullmatch(label):  # nor are the others names
                break
        elif header.count(label) > 1:
            problems.append(f"column '{label}' twice; once is allowed")
    # one that is written wrongly is not missing besides
    if not problems:
        missing = [f"'{label}'" for label in required if label not in header]
        verb = "is missing; it is required" if len(missing) == 1 else "are missing; required"
        if missing:
            problems.append(f"column{'s' * (len(missing) > 1)} {', '.join(missing)} {verb}")
    if problems:
        raise InputError(f"{place}: {in_one_line(problems)}")


def quote(text: str, longest: int = 40) -> str:
    """Text for a message, its middle left out if it is long."""
    half = longest // 2
    return text if len(text) <= longest else f"{text[:half]}...{text[-half:]}"


def _contents(name: str) -> Iterator[tuple[int, str, float]]:
    """Lines that say something: number, text without comment, and the fraction of the file."""
    try:
        text = read_regular_file(name, "CSV").decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise unreadable(name, "CSV") from error
    rows = text.splitlines()
    for line, content in enumerate(rows, start=1):
        content = content.partition("#")[0].strip()
        if content:
            yield line, content, line / len(rows)


def _number(name: str, line: int, label: str, cell: str) -> float:
    value = float(cell) if NUMBER.fullmatch(cell) else np.nan
    if not abs(value) <= _LARGEST:
        raise InputError(
            f"{name}, line {line}, column {label}: '{quote(cell)}'; a finite number is required"
        )
    return value
