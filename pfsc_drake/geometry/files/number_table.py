"""CSV files: columns of numbers under a line of names, and their units of length."""

import re
import stat
from collections.abc import Callable, Collection, Iterator
from pathlib import Path as FilePath
from typing import Literal, NamedTuple

import numpy as np

from pfsc_drake.checks import NUMBER
from pfsc_drake.errors import (
    InputError,
    did_you_mean,
    in_one_line,
    nearest_file,
    shorten,
    suggestion,
)
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
    """Return the content of a file.

    Args:
        name: Name of a regular file of at most 256 MiB.
        kind: Expected kind of file, for messages, such as "CSV".

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
    return InputError(f"{shorten(str(name), 1000)}: {what}; a readable {kind} file is required")


MAX_ROWS = 1_000_000
_ROWS_PER_REPORT = 50_000
_LARGEST = 1e12
# in the order in which they are searched in the names of columns; white space is the last
_SEPARATORS = (";", "\t", "|", ",")
_G_CODE = re.compile(r"(N\d+\s*)?G\d{1,3}(\.\d)?(\s.*)?")
_G_CODE_BEGINS = 20  # lines
# Similarity to a known name and length from which a name counts as misspelt.
_SLIP, _SHORTEST_SLIP = 0.75, 4


class NumberTable(NamedTuple):
    """Columns of numbers.

    Attributes:
        lines: Line numbers of the rows in the file, [n].
        header: Names of the columns, [m].
        rows: [n, m].
        ignored: Names of further columns.
    """

    lines: list[int]
    header: list[str]
    rows: np.ndarray
    ignored: list[str]

    def notes(self, name: str) -> tuple[str, ...]:
        """Return sentences on ignored columns.

        Args:
            name: Name of the file.
        """
        if not self.ignored:
            return ()
        columns = ", ".join(f"'{quote(label)}'" for label in self.ignored[:_MOST_NAMED])
        more = ", .." if len(self.ignored) > _MOST_NAMED else ""
        plural = "s" * (len(self.ignored) > 1)
        return (f"{name}: column{plural} {columns}{more} ignored",)


_MOST_NAMED = 6


def read_numbers(
    name: str,
    what: str,
    check_header: Callable[[str, list[str]], None],
    progress: Progress | None = None,
    known: Collection[str] | None = None,
) -> NumberTable:
    """Read a CSV file.

    The first line that is neither empty nor a comment (#) names the columns. Semicolons, tabs,
    bars, commas or white space separate them; with other separators than commas numbers may have a
    decimal comma.

    Args:
        name: Name of a regular file of at most 256 MiB and 1,000,000 rows.
        what: Name of the rows in messages, such as "waypoints".
        check_header: Refuses names of columns; called with their location and the names.
        progress: Callback with the fraction read and the name of the step.
        known: Columns that are read, of those that pass `check_header`; all by default.

    Raises:
        InputError: The file cannot be read or is too large, is G-code, has no rows or rows of
            different lengths, or a value is not a number.
    """
    header: list[str] = []
    columns: list[int] = []
    separator: str | None = ","
    lines: list[int] = []
    rows: list[list[float]] = []
    for line, content, fraction in _contents(name):
        if not header:
            separator = next((mark for mark in _SEPARATORS if mark in content), None)
            header = [cell.strip("\"'") for cell in _cells(content, separator)]
            check_header(f"{name}, line {line}", header)
            columns = [i for i, label in enumerate(header) if known is None or label in known]
            continue
        cells = _cells(content, separator)
        if len(cells) != len(header):
            hint = ""
            if separator == "," and len(cells) == 2 * len(header):
                hint = "; numbers with a decimal comma need columns separated by semicolons"
            raise InputError(
                f"{name}, line {line}: {len(cells)} values; {len(header)} are required{hint}"
            )
        if separator != ",":
            cells = [cell.replace(",", ".") for cell in cells]
        rows.append([_number(name, line, header[i], cells[i]) for i in columns])
        lines.append(line)
        if len(rows) > MAX_ROWS:
            raise InputError(
                f"{name}: more than {MAX_ROWS} {what}; so many are the most that are read"
            )
        if progress is not None and len(rows) % _ROWS_PER_REPORT == 0:
            progress(fraction, f"reading the {what}")
    if not rows:
        raise InputError(f"{name}: no {what}; a line with column names and data are required")
    ignored = [label for i, label in enumerate(header) if i not in columns]
    return NumberTable(lines, [header[i] for i in columns], np.array(rows), ignored)


def _cells(content: str, separator: str | None) -> list[str]:
    return [cell.strip() for cell in content.split(separator)]


def _refuse_g_code(name: str, rows: list[str]) -> None:
    for line, content in enumerate(rows[:_G_CODE_BEGINS], start=1):
        if _G_CODE.fullmatch(content.strip()):
            raise InputError(
                f"{name}, line {line}: '{quote(content.strip())}' is G-code, which is not read; a"
                " CSV file of points is required, whose first line names the columns"
            )


def check_columns(
    location: str,
    header: list[str],
    known: list[str],
    required: list[str],
    *,
    others: bool = False,
) -> None:
    """Refuse columns that are unknown, there twice, or missing.

    Args:
        location: File and line, for messages.
        header: Names of columns.
        known: Names that are allowed.
        required: Names that must be there.
        others: Whether unknown names are allowed that are neither numbers nor misspelt ones.

    Raises:
        InputError: If a column is unknown, there twice, or missing.
    """
    problems = []
    for label in dict.fromkeys(header):
        if label not in known:
            if others and not _resembles_known(label, known):
                continue
            hint = suggestion(label, known)
            if NUMBER.fullmatch(label):
                hint = "; the first line names the columns"
            allowed = f"{', '.join(known)}{hint}"
            problems.append(f"column '{quote(label)}' is unknown; allowed: {allowed}")
            if NUMBER.fullmatch(label):  # nor are the others names
                break
        elif header.count(label) > 1:
            problems.append(f"column '{label}' twice; once is allowed")
    # a misspelt column is not reported as missing, too
    if not problems:
        missing = [f"'{label}'" for label in required if label not in header]
        verb = "is missing; it is required" if len(missing) == 1 else "are missing; required"
        if missing:
            further = ", ".join(f"'{quote(label)}'" for label in header if label not in known)
            there = f"; further columns are {further}" if further else ""
            problems.append(f"column{'s' * (len(missing) > 1)} {', '.join(missing)} {verb}{there}")
    if problems:
        raise InputError(f"{location}: {in_one_line(problems)}")


def _resembles_known(label: str, known: list[str]) -> bool:
    """Return whether a name is empty, a number, or probably a misspelt known one."""
    if not label or NUMBER.fullmatch(label.replace(",", ".")):
        return True
    if label.lower() in (name.lower() for name in known):
        return True
    return len(label) >= _SHORTEST_SLIP and bool(did_you_mean(label, known, _SLIP))


def quote(text: str, longest: int = 40) -> str:
    """Return a text for a message, its middle omitted if it is long."""
    half = longest // 2
    return text if len(text) <= longest else f"{text[:half]}...{text[-half:]}"


def _contents(name: str) -> Iterator[tuple[int, str, float]]:
    """Yield lines with content: number, text without comment, and the fraction of the file."""
    try:
        text = read_regular_file(name, "CSV").decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise unreadable(name, "CSV") from error
    rows = text.splitlines()
    _refuse_g_code(name, rows)
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


Unit = Literal["m", "cm", "mm", "inch"]

_METRES: dict[str, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254}
UNITS = tuple(_METRES)


def metres(unit: str) -> float:
    """Return the length of a unit in metres.

    Args:
        unit: One of `UNITS`.

    Raises:
        InputError: If the unit is unknown.
    """
    if unit not in _METRES:
        raise InputError(f"unit: '{unit}'; one of {', '.join(UNITS)} is required")
    return _METRES[unit]
