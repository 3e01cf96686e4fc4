"""Sources of YAML data: messages about wrong keys with the file and the line of each key."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from pfsc_drake.errors import InputError, in_one_line

KeyPath = tuple[Any, ...]  # keys and indices, e.g. ("controller", "gains", "eta", 1)
# a line of the file, or the option that has set the value, by key path, e.g. ``path.points[1]``
Locations = dict[str, int | str]
_INTRODUCTIONS = ("unknown key '", "missing key '", "key '")


def join_keys(key_path: KeyPath) -> str:
    """Return a key path in words, e.g. ``controller.gains.eta[1]``."""
    text = ""
    for step in key_path:
        text += f"[{step}]" if type(step) is int and text else f".{step}" if text else f"{step}"
    return text


@dataclass(frozen=True)
class Source:
    """File of some data, for messages.

    Attributes:
        name: Name of the file.
        locations: Locations of its keys; a message about another key has the location of the
            nearest mapping or list around it.
        files: Key paths of names of files, by these files' paths; their keys are put in front of
            messages that begin with such a path.
    """

    name: str
    locations: Locations = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)

    def refusal(self, problems: Sequence[str]) -> InputError:
        """Return the error for one or more problems, in one line.

        One problem has its line behind the name, ``my.yaml:12: duration = ..``, as editors and
        compilers write it; several have it one by one.

        Args:
            problems: Messages; each begins with its key, if it has one.
        """
        texts = [self._with_key(problem) for problem in problems]
        location = self._location(texts[0])
        if len(texts) == 1 and isinstance(location, int):
            return InputError(f"{self.name}:{location}: {texts[0]}")
        return InputError(f"{self.name}: {in_one_line([self._located(text) for text in texts])}")

    def _with_key(self, problem: str) -> str:
        """Return a problem of a file with the key of the file's name in front."""
        for path, key in self.files.items():
            if problem.startswith((f"{path}:", f"cannot read {path}:")):
                return f"{key}: {problem}"
        return problem

    def _located(self, problem: str) -> str:
        """Return a problem with its location in front, if it is known."""
        location = self._location(problem)
        if location is None:
            return problem
        return f"{f'line {location}' if isinstance(location, int) else location}: {problem}"

    def _location(self, problem: str) -> int | str | None:
        """Return the location of the longest key path that a message begins with."""
        text = problem
        for introduction in _INTRODUCTIONS:
            text = text.removeprefix(introduction)
        keys = [key for key in self.locations if _begins_with(text, key)]
        return self.locations[max(keys, key=len)] if keys else None


def override_location(locations: Locations, key: str, option: str) -> None:
    """Set the location of an overridden key, and of all mappings that were created for it.

    Args:
        locations: Locations, which are changed.
        key: Key path of the new value, which replaces everything below it.
        option: Option with the value.
    """
    for old in [other for other in locations if _begins_with(other, key)]:
        del locations[old]
    locations[key] = option
    while "." in key:
        key = key.rpartition(".")[0]
        locations.setdefault(key, option)


def _begins_with(text: str, key: str) -> bool:
    """Return whether a text begins with a key path, not only with a part of a longer word."""
    following = text[len(key) : len(key) + 1]
    return text.startswith(key) and not (following.isalnum() or following in ("_", "-"))
