"""Text of docstrings as MyST Markdown, for cells of tables and for paragraphs."""

import inspect
import re

from pfsc_drake.yaml.fields import attribute_text

_ROLE = re.compile(r":\w+(?::\w+)*:`~?([^`]+)`")
_LITERAL = re.compile(r"``([^`]+)``")
# sections of a docstring after its description
_SECTION = re.compile(r"^(Attributes|Args|Returns|Raises|Yields|Note|Examples?):\n", re.MULTILINE)


def as_markdown(text: str) -> str:
    """Return running text of a docstring as Markdown.

    Args:
        text: reStructuredText as docstrings have it: double backticks, roles.
    """
    text = _ROLE.sub(lambda match: f"`{match[1].rsplit('.', 1)[-1]}`", text)
    text = _LITERAL.sub(r"`\1`", text)
    # escape the characters of mathematics and tags, except in code
    parts = re.split(r"(`[^`]*`)", text)
    for k in range(0, len(parts), 2):
        parts[k] = re.sub(r"([$<>*])", r"\\\1", parts[k])
    return "".join(parts)


def cell(text: str) -> str:
    """Return text of a docstring as a table's cell: one line, without bars."""
    return " ".join(as_markdown(text).split()).replace("|", r"\|")


def description(owner: type) -> str:
    """Return the description of a class before its attributes, as Markdown."""
    text = _SECTION.split(inspect.cleandoc(owner.__dict__.get("__doc__") or ""))[0].strip()
    pieces = []
    for part in re.split(r"\n\n+", text):
        if part.startswith("    "):
            pieces.append(f"```text\n{inspect.cleandoc(part)}\n```")
        elif part.strip() != "::":
            pieces.append(as_markdown(re.sub(r"::$", ":", part)))
    return "\n\n".join(pieces)


def attribute(owner: type, name: str) -> str:
    """Return the docstring of an attribute, also of an inherited one.

    Args:
        owner: The class.
        name: Name of the attribute.

    Raises:
        ValueError: The attribute has no docstring.
    """
    text = attribute_text(owner, name)
    if text is None:
        raise ValueError(f"{owner.__name__}.{name}: has no docstring")
    return text


def table(head: list[str], rows: list[list[str]], kind: str = "") -> str:
    """Return a table.

    Args:
        head: Names of its columns.
        rows: Cells of its rows, as Markdown.
        kind: CSS class of the table.
    """
    lines = [f"{{.{kind}}}"] if kind else []
    lines += [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows)]
    return "\n".join(lines)
