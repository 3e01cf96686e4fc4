"""Notebooks of the site: tutorials import public names alone, studies what there is."""

import ast
import importlib
import re
from pathlib import Path

import pytest

import experiments
import identification
import pfsc_drake

DOCS = Path(__file__).resolve().parents[2] / "docs"
DOORS = {door.__name__: door.__all__ for door in (pfsc_drake, experiments, identification)}
PROJECT = (*DOORS, "diagrams", "reporting")
CELL = re.compile(r"```\{code-cell\} ipython3\n(?::tags:[^\n]*\n\n?)?(.*?)```", re.DOTALL)
TUTORIALS = sorted((DOCS / "tutorials").glob("[0-9]*.md"))
STUDIES = sorted(set((DOCS / "studies").glob("*.md")) - {DOCS / "studies" / "index.md"})


def nodes(notebook: Path) -> list[ast.AST]:
    """Return what the cells of a notebook are made of."""
    text = notebook.read_text(encoding="utf-8")
    assert text.startswith("---\nfile_format: mystnb\n")
    cells = CELL.findall(text)
    assert len(cells) == text.count("{code-cell}")
    return [node for cell in cells for node in ast.walk(ast.parse(cell))]


def test_there_are_notebooks():
    assert (len(TUTORIALS), len(STUDIES)) == (9, 6)
    index = (DOCS / "studies" / "index.md").read_text(encoding="utf-8")
    for study in STUDIES:
        assert f"({study.name})" in index
        assert f"\n{study.stem}\n" in index


@pytest.mark.parametrize("notebook", TUTORIALS, ids=lambda path: path.stem)
def test_only_public_names(notebook):
    for node in nodes(notebook):
        if isinstance(node, ast.Import):
            assert not [a.name for a in node.names if a.name.split(".")[0] in PROJECT]
        elif isinstance(node, ast.ImportFrom) and node.module.split(".")[0] in PROJECT:
            assert {alias.name for alias in node.names} <= set(DOORS[node.module])
        elif isinstance(node, ast.Attribute):
            assert not node.attr.startswith("_")


@pytest.mark.parametrize("notebook", STUDIES, ids=lambda path: path.stem)
def test_studies_import_what_there_is(notebook):
    found = [node for node in nodes(notebook) if isinstance(node, ast.ImportFrom)]
    assert found
    for node in found:
        module = importlib.import_module(node.module)
        assert [alias.name for alias in node.names if not hasattr(module, alias.name)] == []
