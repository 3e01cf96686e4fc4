"""The picture of a station."""

from pathlib import Path
from xml.etree import ElementTree

import pytest

from diagrams.builder import build_station
from diagrams.drawing.block_diagram import block_diagram_dot, block_diagram_svg

BLOCKS = (
    "plant",
    "joint_encoders",
    "tool_kinematics",
    "path_projector",
    "following_controller",
    "reference_generator",
    "hold",
)


@pytest.fixture
def diagram(load_scenario):
    settings = load_scenario("pfc_elastic_3r")
    settings.controller.law = "rigid"
    return build_station(settings, Path()).diagram


def put_dot(folder, monkeypatch, script):
    """Make a program ``dot`` the only one that is found."""
    program = folder / "dot"
    program.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))


def test_dot_text_names_every_block(diagram):
    text = block_diagram_dot(diagram)
    assert text.lstrip().startswith("digraph")
    for block in (*BLOCKS, "pfc_elastic_3r"):
        assert block in text
    assert text.count("->") >= len(diagram.connection_map())
    # the plant's inside stays closed
    assert text.count("subgraph cluster") < 20


def test_svg_is_what_graphviz_draws(diagram, tmp_path, monkeypatch):
    put_dot(tmp_path, monkeypatch, 'read -r first; echo "<svg>$1 $first</svg>"')
    first = block_diagram_dot(diagram).splitlines()[0]
    assert block_diagram_svg(diagram) == f"<svg>-Tsvg {first.strip()}</svg>\n"


def test_no_picture_without_graphviz(diagram, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert block_diagram_svg(diagram) is None
    put_dot(tmp_path, monkeypatch, "exit 1")
    assert block_diagram_svg(diagram) is None


def test_installed_graphviz(diagram):
    svg = block_diagram_svg(diagram)
    if svg is None:
        pytest.skip("graphviz is not installed")
    root = ElementTree.fromstring(svg.encode())
    assert root.tag.endswith("svg")
    for block in BLOCKS:
        assert block in svg
