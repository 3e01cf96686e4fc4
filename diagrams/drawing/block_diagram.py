"""A picture of a diagram's blocks and connections."""

import shutil
import subprocess

from pydrake.systems.framework import Diagram


def block_diagram_dot(diagram: Diagram) -> str:
    """Return the diagram as graphviz text."""
    return diagram.GetGraphvizString(max_depth=2)


def block_diagram_svg(diagram: Diagram) -> str | None:
    """Return the diagram as SVG text, or None where graphviz is not installed."""
    if shutil.which("dot") is None:
        return None
    drawn = subprocess.run(
        ["dot", "-Tsvg"],
        input=block_diagram_dot(diagram),
        capture_output=True,
        text=True,
        check=False,
        timeout=30,
    )
    return drawn.stdout if drawn.returncode == 0 else None
