"""Gallery: every shipped scenario with a picture, a sentence and its command."""

import re
from pathlib import Path

import yaml

from docs.making.text import as_markdown

ROOT = Path(__file__).resolve().parents[2]
_FOLDERS = {
    "scenarios": ROOT / "experiments" / "scenarios",
    "pictures": ROOT / "docs/images/gallery",
}
_KINDS = {
    "pfc": "Paths",
    "sfc": "Surfaces",
    "vf": "Fixtures and forbidden regions",
    "plate": "Mounting a plate",
    "": "Operators, friction, comparison",
}
_SENTENCE = re.compile(r"^.*?[.](?=\s|$)", re.DOTALL)


def gallery() -> str:
    """Return cards of all shipped scenarios as Markdown, by the first part of their names."""
    groups: dict[str, list[str]] = {kind: [] for kind in _KINDS}
    for file in sorted(_FOLDERS["scenarios"].glob("*.yaml")):
        kind = file.stem.split("_")[0]
        groups[kind if kind in groups else ""].append(_card(file))
    page = []
    for kind, cards in groups.items():
        page += [f"## {_KINDS[kind]}", "::::{grid} 1 1 2 2", ":gutter: 3", "", *cards, "::::", ""]
    return "\n".join(page)


def first_sentence(text: str) -> str:
    """Return the first sentence of a description; the whole text if it has no full stop."""
    line = " ".join(text.split())
    found = _SENTENCE.match(line)
    return found[0] if found else line


def _card(file: Path) -> str:
    data = yaml.load(_untagged(file.read_text(encoding="utf-8")), Loader=yaml.CSafeLoader)
    section = f" ({data['section']})" if data.get("section") else ""
    lines = [f":::{{grid-item-card}} `{file.stem}`"]
    pictures = [_FOLDERS["pictures"] / f"{file.stem}{suffix}" for suffix in (".webp", ".png")]
    for picture in [picture for picture in pictures if picture.exists()][:1]:
        lines.append(f":img-bottom: ../images/gallery/{picture.name}")
        lines.append(f":img-alt: Scene of {file.stem}")
    sentence = as_markdown(first_sentence(data.get("description", "")))
    command = f"```sh\npfsc run {file.stem}\n```"
    return "\n".join([*lines, "", f"{sentence}{section}", "", command, ":::", ""])


def _untagged(text: str) -> str:
    return re.sub(r"(?<=[\s\[:-])!\w+", "", text)
