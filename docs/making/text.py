"""Text of docstrings as MyST Markdown: what stands in a cell, what stands under a heading."""

import inspect
import re

from pfsc_drake.yaml.fields import attribute_text

_ROLE = re.compile(r":\w+(?::\w+)*:`~?([^`]+)`")
_LITERAL = re.compile(r"``([^`]+)``")
# of the sections of a docstring, which begin what is no description
_SECTION = re.compile(r"^(Attributes|Args|Returns|Raises|Yields|Note|Examples?):\n", re.MULTILINE)


def as_markdown(text: str) -> str:
    """Return running text of a docstring as Markdown.

    Args:
        text: reStructuredText as docstrings have it: double backticks, roles.
    """
    text = _ROLE.sub(lambda match: f"`{match[1].rsplit('.', 1)[-1]}`", text)
    text = _LITERAL.sub(r"`\1`", text)
    # what Markdown would take for mathematics or a tag; in code it is left alone
    parts = re.split(r"(`[^`]*`)", text)
    for k in range(0, len(parts), 2):
        parts[k] = re.sub(r"([$<>*])", r"\\\1", parts[k])
    return "".join(parts)


def cell(text: str) -> str:
    """Return text of a docstring as a table's cell: one line, without bars."""
    return " ".join(as_markdown(text).split()).replace("|", r"\|")


def description(owner: type) -> str:
    """Return what a class says of itself before its attributes, as Markdown."""
    text = _SECTION.split(inspect.cleandoc(owner.__dict__.get("__doc__") or ""))[0].strip()
    pieces = []
    for part in re.split(r"\n\n+", text):
        if part.startswith("    "):
            pieces.append(f"```text\n{inspect.cleandoc(part)}\n```")
        elif part.strip() != "::":
            pieces.append(as_markdown(re.sub(r"::$", ":", part)))
    return "\n\n".join(pieces)


def attribute(owner: type, name: str) -> str:
    """Return what a class, or one that it inherits from, says of an attribute.

    Args:
        owner: The class.
        name: Name of the attribute.

    Raises:
        ValueError: If nobody says anything.
    """
    text = attribute_text(owner, name)
    if text is None:
        raise ValueError(f"{owner.__name__}.{name}: no docstring says what it is")
    return text


def table(head: list[str], rows: list[list[str]], kind: str = "") -> str:
    """Return a table.

    Args:
        head: Names of its columns.
        rows: Cells of its rows, as Markdown.
        kind: Class of the table, for its style.
    """
    lines = [f"{{.{kind}}}"] if kind else []
    lines += [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows)]
    return "\n".join(lines)
