"""Tutorials import what users import, and nothing else of this project."""

import ast
import re
from pathlib import Path

import pytest

import experiments
import identification
import pfsc_drake

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "tutorials"
DOORS = {door.__name__: door.__all__ for door in (pfsc_drake, experiments, identification)}
PROJECT = (*DOORS, "diagrams", "reporting")
CELL = re.compile(r"```\{code-cell\} ipython3\n(?::tags:[^\n]*\n\n?)?(.*?)```", re.DOTALL)
NOTEBOOKS = sorted(FOLDER.glob("[0-9]*.md"))


def test_there_are_tutorials():
    assert len(NOTEBOOKS) == 8


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_only_public_names(notebook):
    text = notebook.read_text(encoding="utf-8")
    assert text.startswith("---\nfile_format: mystnb\n")
    cells = CELL.findall(text)
    assert len(cells) == text.count("{code-cell}")
    for cell in cells:
        for node in ast.walk(ast.parse(cell)):
            if isinstance(node, ast.Import):
                assert not [a.name for a in node.names if a.name.split(".")[0] in PROJECT]
            elif isinstance(node, ast.ImportFrom) and node.module.split(".")[0] in PROJECT:
                assert {alias.name for alias in node.names} <= set(DOORS[node.module])
            elif isinstance(node, ast.Attribute):
                assert not node.attr.startswith("_")
