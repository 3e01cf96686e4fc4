"""Text of a first scenario, with a comment on each choice."""

from collections.abc import Mapping
from typing import Any

import yaml

_COMMENT_COLUMN, _WIDEST = 48, 120


class ScenarioText:
    """Text of a first scenario.

    Args:
        title: Comment at the top.
    """

    def __init__(self, title: str) -> None:
        self._lines = [f"# {title}"]

    def add(
        self, indent: int, key: str, value: Any = None, reason: str = "", tag: str = ""
    ) -> None:
        """Add a key.

        Args:
            indent: Depth of the key.
            key: Its name.
            value: Its value; none for a mapping whose keys follow.
            reason: Comment behind it.
            tag: YAML tag of the value.
        """
        words = [f"{'  ' * indent}{key}:"] + [tag] * bool(tag)
        line = " ".join(words + ([] if value is None else [_flow(value)]))
        commented = f"{line:<{_COMMENT_COLUMN}}  # {reason}" if reason else line
        if len(commented) <= _WIDEST:
            self._lines.append(commented)
        else:
            self._lines += [f"{'  ' * indent}# {reason}", line]

    def __str__(self) -> str:
        return "\n".join(self._lines) + "\n"


def _flow(value: Any) -> str:
    """Return a value as YAML of one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_flow(k)}: {_flow(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_flow(v) for v in value) + "]"
    return yaml.safe_dump(value, width=10_000).removesuffix("\n").removesuffix("\n...")
