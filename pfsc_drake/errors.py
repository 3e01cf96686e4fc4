"""The error for input that cannot be used."""

import difflib
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import islice
from pathlib import Path

MAX_MESSAGE = 1000  # characters
_SHORTEST_SHARE = 150  # characters of one problem among others
_MOST_FILES = 10_000  # of a folder that is searched for a name


class InputError(ValueError):
    """Error for wrong input, raised where it enters, before anything moves.

    The message is one line with the name (file, key, parameter), its value and the allowed ones. A
    message of more than MAX_MESSAGE characters is shortened in its middle, where the value stands.
    """

    def __init__(self, message: str) -> None:
        super().__init__(shorten(message, MAX_MESSAGE))


class WriteError(InputError):
    """Error for results that could not be written, because a disk is full or broken."""


def shorten(text: str, length: int = 60) -> str:
    """Returns a text, without its middle if it is longer than ``length`` characters."""
    if len(text) <= length:
        return text
    tail = (length - 3) // 3
    return f"{text[: length - 3 - tail]}...{text[len(text) - tail :]}"


def did_you_mean(word: object, known: Iterable[str], cutoff: float = 0.6) -> str:
    """Return ``did you mean 'elastic'? ``, or nothing if no word is similar.

    Args:
        word: The word that was written.
        known: Known words.
        cutoff: Required similarity, from 0 to 1.
    """
    text, words = str(word), list(known)
    if len(text) > max(map(len, words), default=0) + 20:  # similar to none, and slow to compare
        return ""
    nearest = difflib.get_close_matches(text, words, n=1, cutoff=cutoff)
    if not nearest:  # ignore the case
        small = {name.lower(): name for name in words}
        found = difflib.get_close_matches(text.lower(), small, n=1, cutoff=cutoff)
        nearest = [small[name] for name in found]
    return f"did you mean {nearest[0]!r}? " if nearest else ""


def suggestion(word: object, known: Iterable[str]) -> str:
    """Return the same for the end of a message, ``; did you mean 'elastic'?``, or nothing."""
    hint = did_you_mean(word, known)
    return f"; {hint.rstrip()}" if hint else ""


def nearest_file(path: Path) -> str:
    """Return ``; did you mean 'points.csv'?`` for a missing file, or nothing.

    Args:
        path: The file; other names in its folder are searched.
    """
    try:
        names = [file.name for file in islice(path.parent.iterdir(), _MOST_FILES)]
    except (OSError, ValueError):  # the folder is missing or not readable
        return ""
    return suggestion(path.name, (name for name in names if name.isprintable()))


def in_one_line(problems: Sequence[str]) -> str:
    """Return one or more problems, numbered if there are several, within MAX_MESSAGE characters.

    Args:
        problems: Problems, at least one.
    """
    if len(problems) == 1:
        return problems[0]
    parts: list[str] = []
    budget = MAX_MESSAGE - 150  # for the file's name in front, and for problems left out
    for number, problem in enumerate(problems, start=1):
        share = max(_SHORTEST_SHARE, budget // (len(problems) - len(parts)) - 7)
        if budget < share:
            break
        if len(problem) > share:  # the nearest word says more than all of them
            problem = re.sub(r"(did you mean .*\?) allowed: .*", r"\1", problem)
        parts.append(f"({number}) {shorten(problem, share)}")
        budget -= len(parts[-1]) + 2
    left = len(problems) - len(parts)
    more = f"; and {left} more" if left else ""
    return f"{len(problems)} things are wrong: {'; '.join(parts)}{more}"


# refused values by key, while refusals are collected
_gathered: ContextVar[dict[str, InputError] | None] = ContextVar("gathered", default=None)


@contextmanager
def gathered_refusals() -> Iterator[list[str]]:
    """Collect refusals of :func:`require` instead of raising them, as a list that is filled later.

    The first refusal of each key counts. Calculations with refused values may fail in any way;
    therefore other exceptions are ignored once there is a refusal.
    """
    refusals: dict[str, InputError] = {}
    messages: list[str] = []
    token = _gathered.set(refusals)
    try:
        yield messages
    except Exception as error:
        if isinstance(error, InputError):
            refusals = refusals or {"": error}
        elif not refusals:
            raise
    finally:
        _gathered.reset(token)
        messages[:0] = [str(error) for error in refusals.values()]


def require(condition: bool, key: str, value: object, allowed: str) -> None:
    """Refuse a value.

    Args:
        condition: Whether the value is allowed.
        key: Its key.
        value: The value.
        allowed: Allowed values in words.

    Raises:
        InputError: If it is not; within :func:`gathered_refusals` at the end.
    """
    if not condition:
        shown = value.tolist() if hasattr(value, "tolist") else value
        _refuse(key, f"{key} = {shown if shown != '' else repr(shown)}; allowed: {allowed}")


def require_one_of(key: str, value: object, allowed: Iterable[str]) -> None:
    """Refuse a word that is not allowed, and suggest the nearest.

    Args:
        key: Its key.
        value: The word.
        allowed: Allowed words.

    Raises:
        InputError: As :func:`require`.
    """
    words = list(allowed)
    if value not in words:
        _refuse(key, f"{key} = {value}; allowed: {', '.join(words)}{suggestion(value, words)}")


def _refuse(key: str, message: str) -> None:
    refusals = _gathered.get()
    if refusals is None:
        raise InputError(message)
    refusals.setdefault(key, InputError(message))


def require_positive(key: str, value: float) -> None:
    """Refuse a value that is not a positive finite number."""
    require(0.0 < value < math.inf, key, value, "a positive number")
