"""What README and docs/*.md tell a reader to write: YAML, commands, Python.

A YAML block with the name of a shipped scenario beside ``yaml`` is a part of such a scenario, one
without a name is whole. A block that begins with ``# one of`` has a part in every line.
"""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
# but what tutorials wrote when they were executed
PAGES = [
    file
    for file in sorted((ROOT / "docs").rglob("*.md"))
    if "out" not in file.relative_to(ROOT).parts
]
DOCUMENTS = [ROOT / "README.md", *PAGES]
ONE_OF = "# one of\n"

_FENCED = re.compile(r"^```([^\n]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_IN_TEXT = re.compile(r"`([^`\n]*(?:python -m|pfsc) [^`\n]*)`")
_INDENTED = re.compile(r"^    ((?:python -m|pfsc) .*)$", re.MULTILINE)
_PROGRAM = re.compile(
    r"(?:\S*/)?(python -m experiments|python -m identification|pfsc identify|pfsc)\b ?(.*)"
)
_PACKAGES = {
    "python -m experiments": "experiments",
    "python -m identification": "identification",
    "pfsc": "experiments",
    "pfsc identify": "identification",
}
_COMMANDS = ("", "sh", "bash")


class Block(NamedTuple):
    """A block of a document.

    Attributes:
        place: Document and line.
        language: First word beside the fence.
        scenario: The other one, or empty.
        text: Its content.
    """

    place: str
    language: str
    scenario: str
    text: str


class Command(NamedTuple):
    """A command of a document.

    Attributes:
        place: Document and line.
        program: Name of the package that is run.
        words: What follows.
    """

    place: str
    program: str
    words: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.place}: {' '.join(self.words)}"


def blocks(*languages: str) -> list[Block]:
    """Returns all fenced blocks in given languages."""
    found = []
    for file in DOCUMENTS:
        text = file.read_text(encoding="utf-8")
        for match in _FENCED.finditer(text):
            language, _, scenario = match[1].strip().partition(" ")
            if language in languages:
                place = f"{file.name}:{text.count(chr(10), 0, match.start()) + 1}"
                found.append(Block(place, language, scenario, match[2]))
    return found


def commands() -> list[Command]:
    """Returns all commands, those of synopses without their brackets."""
    lines = [
        (block.place, line)
        for block in blocks(*_COMMANDS)
        for line in block.text.replace("\\\n", " ").splitlines()
    ]
    for file in DOCUMENTS:
        text = file.read_text(encoding="utf-8")
        for match in [*_IN_TEXT.finditer(text), *_INDENTED.finditer(text)]:
            place = f"{file.name}:{text.count(chr(10), 0, match.start()) + 1}"
            lines.append((place, match[1]))
    return list(_parsed(lines))


def _parsed(lines: list[tuple[str, str]]) -> Iterator[Command]:
    for place, line in lines:
        match = _PROGRAM.match(line)
        if match is None:
            continue
        arguments = re.sub(r"\[(--[^\[\]]*)\]", r"\1", match[2])
        words = [word for word in shlex.split(arguments, comments=True) if word != ".."]
        if words:
            yield Command(place, _PACKAGES[match[1]], tuple(words))
