"""How the project's figures look: colours, sizes, grid, panels, and the picture of each.

Matplotlib is imported when something is drawn.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

FloatArray = NDArray[np.float64]

# Okabe and Ito's palette: told apart with any colour vision, and in this order by lightness.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A5195")
REFERENCE = "#6B7280"
INK = "#1F2937"
GRID = "#E5E7EB"
ALERT = "#B91C1C"

# A reference, drawn first: what follows it stays visible on top, and where it does not.
BROAD: dict[str, Any] = {"color": "#9CA3AF", "linewidth": 4.0, "alpha": 0.6}

WIDTH = 9.0  # inches; at DPI 200 the page shows it at half size on screens of double density
DPI = 200
TITLE_SIZE, LEGEND_SIZE = 11.0, 10.0  # points
LINE_WIDTH = 560.0  # points, what title and legend share above a panel
MICRO_BELOW = 1e-4  # m or rad

STYLE: Any = {  # Any: matplotlib's own type of the keys changes with its version
    "axes.edgecolor": "#9CA3AF",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.labelcolor": INK,
    "axes.labelsize": 11,
    "axes.linewidth": 0.8,
    "axes.prop_cycle": f"cycler('color', {list(COLOURS)})",
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": TITLE_SIZE,
    "axes.titleweight": "bold",
    "axes.xmargin": 0.01,
    "figure.constrained_layout.use": True,
    "figure.dpi": DPI,
    "font.size": 11,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "legend.fontsize": LEGEND_SIZE,
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
    """A figure as a picture.

    Attributes:
        name: Name of its file, without suffix.
        title: A few words.
        caption: What to see in it, one or two sentences.
        png: The picture.
    """

    name: str
    title: str
    caption: str
    png: bytes = field(repr=False)

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        """Return the picture for a notebook, and how wide it is shown [pixels]."""
        return self.png, {"width": round(WIDTH * DPI / 2)}


@dataclass
class Drawing:
    """A figure as drawn.

    Attributes:
        name: Name of its file, without suffix.
        title: A few words.
        caption: What to see in it, one or two sentences.
        canvas: The drawing.
    """

    name: str
    title: str
    caption: str
    canvas: "Canvas"


@contextmanager
def styled() -> Iterator[None]:
    """Draw in the project's style."""
    from matplotlib import rc_context

    with rc_context(STYLE):
        yield


def make_canvas(width: float, height: float) -> "Canvas":
    """Return an empty canvas of a width and height [inches]."""
    from matplotlib.figure import Figure as Canvas

    return Canvas(figsize=(width, height))


def make_panels(
    count: int, height: float = 2.3, common_time: bool = True
) -> "tuple[Canvas, list[Axes]]":
    """A canvas with panels one above the other, on a common time axis unless told otherwise.

    Args:
        count: Number of panels.
        height: Height of one panel [inches].
        common_time: Whether time is the horizontal axis of all.

    Returns:
        The canvas and its panels from top to bottom.
    """
    canvas = make_canvas(WIDTH, height * count + 0.5)
    panels = canvas.subplots(count, 1, sharex=common_time, squeeze=False)[:, 0]
    if common_time:
        panels[-1].set_xlabel("time in s")
    return canvas, list(panels)


def draw_components(
    panel: "Axes", time: ArrayLike, values: ArrayLike, labels: list[str], style: str = "-"
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


def draw_reference(panel: "Axes", time: ArrayLike, values: ArrayLike, label: str) -> None:
    """Draws the columns of a reference broad and pale, each in its component's colour.

    Args:
        panel: Where to draw, before what follows the reference.
        time: [samples] s.
        values: [samples, dim] in the panel's unit.
        label: One entry of the legend for all columns, in grey.
    """
    for index, column in enumerate(np.asarray(values).T):
        panel.plot(time, column, **BROAD | {"color": COLOURS[index % len(COLOURS)], "alpha": 0.3})
    add_entry(panel, label, **BROAD)


def add_entry(panel: "Axes", label: str, **line: Any) -> None:
    """Add an entry to a panel's legend that stands for several lines.

    Args:
        panel: The panel.
        label: Text of the entry.
        line: Properties of its line, as matplotlib has them.
    """
    from matplotlib.lines import Line2D

    panel.add_line(Line2D([], [], label=label, **line))


def shade(
    panels: "list[Axes]",
    time: FloatArray,
    where: ArrayLike,
    label: str,
    colour: str,
    hatch: str = "",
) -> None:
    """Shade the times at which something holds, from sample to sample.

    Gaps that no screen shows are shaded, too: what flickers has as many intervals as samples.

    Args:
        panels: All of them are shaded; the first gets an entry for the legend.
        time: [samples] s.
        where: [samples] bool.
        label: Name of what holds.
        colour: Colour of the shade.
        hatch: Pattern, where colour alone could be mistaken.
    """
    from matplotlib.collections import PolyCollection

    spans = _visible_spans(time, where)
    if not len(spans):
        return
    corners = np.stack([spans[:, [0, 0, 1, 1]], np.tile([0.0, 1.0, 1.0, 0.0], (len(spans), 1))], -1)
    for panel in panels:
        shades = PolyCollection(
            list(corners),
            transform=panel.get_xaxis_transform(),
            facecolor=colour,
            edgecolor="#9CA3AF" if hatch else "none",
            linewidth=0.0,
            alpha=0.45,
            hatch=hatch,
            zorder=0.5,
            label=label if panel is panels[0] else None,
        )
        panel.add_collection(shades, autolim=False)


def _visible_spans(time: FloatArray, where: ArrayLike) -> FloatArray:
    """Return beginnings and ends of intervals with gaps that can be seen, [intervals, 2] s."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(where, dtype=int), [0]])))
    if not edges.size:
        return np.zeros((0, 2))
    begins, ends = time[edges[::2]], time[np.minimum(edges[1::2], len(time) - 1)]
    seen = begins[1:] - ends[:-1] > (time[-1] - time[0]) / (WIDTH * DPI)
    return np.column_stack([begins[np.r_[True, seen]], ends[np.r_[seen, True]]])


def late_samples(time: FloatArray) -> NDArray[np.bool_]:
    """Which samples are of the last three quarters of a run, [samples] bool.

    Args:
        time: [samples] s.
    """
    return np.asarray(time >= time[0] + 0.25 * (time[-1] - time[0]))


def scale_to_late(panel: "Axes", time: FloatArray, values: FloatArray) -> None:
    """Scales a panel, zero in the middle, to the last three quarters of what it shows.

    Args:
        panel: To scale.
        time: [samples] s.
        values: [samples, dim] in the panel's unit.
    """
    span = 1.2 * largest(values[late_samples(time)])
    if span > 0.0:
        panel.set_ylim(-span, span)


def is_dwarfed(time: FloatArray, values: FloatArray, ratio: float = 1.2) -> bool:
    """Whether the last three quarters of a run are dwarfed by what comes before.

    Args:
        time: [samples] s.
        values: [samples, dim] in any unit.
        ratio: Ratio of the largest magnitudes, from which on it counts.
    """
    return 0.0 < ratio * largest(values[late_samples(time)]) < largest(values)


def largest(values: FloatArray) -> float:
    """Largest finite magnitude, 0 of none.

    Args:
        values: Any shape.
    """
    return float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))


def fitting_unit(values: FloatArray, unit: str) -> tuple[float, str]:
    """Milli, or micro where milli would leave nothing but decimals.

    Args:
        values: Any shape, in ``unit``.
        unit: Unit of the values.

    Returns:
        Factor from ``unit`` to the one for the axis, and its name.
    """
    return (1e6, f"µ{unit}") if 0.0 < largest(values) < MICRO_BELOW else (1e3, f"m{unit}")


def place_legend(panel: "Axes", columns: int | None = None) -> None:
    """Legend above the panel's right end, and above its title too where both are long.

    Args:
        panel: Whose legend; titles and lines are there already.
        columns: Number of columns, by default all entries in one row.
    """
    labels = panel.get_legend_handles_labels()[1]
    entries = sum(_text_width(label, LEGEND_SIZE) + 3.8 * LEGEND_SIZE for label in labels)
    title = panel.get_title("left") or panel.get_title()
    beside = entries + _text_width(title, TITLE_SIZE, "bold") < LINE_WIDTH
    panel.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=columns or len(labels),
        borderaxespad=0.1 if beside else 2.0,
        handlelength=1.6,
        columnspacing=1.4,
    )


@cache
def _text_width(text: str, size: float, weight: str = "normal") -> float:
    """Width of a line of text [points]."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    if not text:
        return 0.0
    font = FontProperties(weight=weight)
    return float(TextPath((0.0, 0.0), text, size=size, prop=font).get_extents().width)


def render(drawing: Drawing) -> Figure:
    """Returns the picture of a drawing."""
    drawing.canvas.align_ylabels()
    picture = BytesIO()
    drawing.canvas.savefig(picture, format="png", dpi=DPI, facecolor="white")
    return Figure(drawing.name, drawing.title, drawing.caption, picture.getvalue())
