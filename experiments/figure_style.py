"""How the project's figures look: colours, sizes, grid, and the file a figure becomes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from numpy.typing import ArrayLike

matplotlib.use("Agg")

# Okabe and Ito's palette: told apart with any colour vision, and in this order by lightness.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A5195")
REFERENCE = "#6B7280"
INK = "#1F2937"
GRID = "#E5E7EB"
ALERT = "#B91C1C"

WIDTH = 9.0  # inches; at DPI 200 the page shows it at half size on screens of double density
DPI = 200

STYLE: Any = {  # Any: matplotlib's own type of the keys changes with its version
    "axes.edgecolor": "#9CA3AF",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.labelcolor": INK,
    "axes.labelsize": 11,
    "axes.linewidth": 0.8,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "axes.xmargin": 0.01,
    "figure.constrained_layout.use": True,
    "figure.dpi": DPI,
    "font.size": 11,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "legend.fontsize": 10,
    "legend.frameon": True,
    "legend.framealpha": 0.9,
    "legend.edgecolor": "none",
    "lines.linewidth": 1.6,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.labelsize": 10,
    "ytick.labelsize": 10,
}


@dataclass
class Figure:
    """A figure as written.

    Attributes:
        path: PNG file.
        title: A few words.
        caption: What to see in it, one or two sentences.
    """

    path: Path
    title: str
    caption: str


def make_panels(count: int, height: float = 2.3) -> tuple[Canvas, list[Axes]]:
    """A canvas with panels one above the other on a common time axis.

    Args:
        count: Number of panels.
        height: Height of one panel [inches].

    Returns:
        The canvas and its panels from top to bottom.
    """
    canvas = Canvas(figsize=(WIDTH, height * count + 0.5))
    panels = canvas.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    panels[-1].set_xlabel("time in s")
    return canvas, list(panels)


def draw_components(
    panel: Axes, time: ArrayLike, values: ArrayLike, labels: list[str], style: str = "-"
) -> None:
    """Draws the columns of a signal, always in the same colours.

    Args:
        panel: Where to draw.
        time: [samples] s.
        values: [samples, dim] in the panel's unit.
        labels: One per column.
        style: Line style.
    """
    for index, (column, label) in enumerate(zip(np.asarray(values).T, labels, strict=True)):
        panel.plot(time, column, style, color=COLOURS[index % len(COLOURS)], label=label)


def place_legend(panel: Axes, columns: int | None = None) -> None:
    """Legend above the panel's right end, where no data is.

    Args:
        panel: Whose legend.
        columns: Number of columns, by default all entries in one row.
    """
    count = len(panel.get_legend_handles_labels()[0])
    panel.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=columns or count,
        borderaxespad=0.1,
        handlelength=1.6,
        columnspacing=1.4,
    )


def save_canvas(canvas: Canvas, path: Path) -> None:
    """Writes a canvas as PNG.

    Args:
        canvas: To write.
        path: PNG file.
    """
    canvas.align_ylabels()
    canvas.savefig(path, dpi=DPI, facecolor="white")
