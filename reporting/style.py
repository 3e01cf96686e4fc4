"""Style of the project's figures: colours, sizes, grid, panels, and rendering.

Matplotlib is imported with the first drawing.
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

# Okabe and Ito's palette: distinguishable with any colour vision, and in this order by lightness
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A5195")
REFERENCE = "#6B7280"
INK = "#1F2937"
GRID = "#E5E7EB"
ALERT = "#B91C1C"

# a reference, drawn first: the signal stays visible on top, and the reference where they differ
BROAD: dict[str, Any] = {"color": "#9CA3AF", "linewidth": 4.0, "alpha": 0.6}

WIDTH = 9.0  # inches; at DPI 200 the page shows it at half size on screens of double density
DPI = 200
TITLE_SIZE, LEGEND_SIZE = 11.0, 10.0  # points
LINE_WIDTH = 560.0  # points, shared by title and legend above a panel
MICRO_BELOW = 1e-4  # m or rad
_ROUNDING = 1e-9  # units of an axis, such as mm; smaller values are rounding errors

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
    """A figure as an image.

    Attributes:
        name: Name of its file, without suffix.
        title: Title.
        caption: Explanation, one or two sentences.
        png: Image.
    """

    name: str
    title: str
    caption: str
    png: bytes = field(repr=False)

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        """Return the image for a notebook, and its displayed width [pixels]."""
        return self.png, {"width": round(WIDTH * DPI / 2)}


@dataclass
class Drawing:
    """A drawn figure.

    Attributes:
        name: Name of its file, without suffix.
        title: Title.
        caption: Explanation, one or two sentences.
        canvas: Drawing.
    """

    name: str
    title: str
    caption: str
    canvas: "Canvas"


@contextmanager
def project_style() -> Iterator[None]:
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
    """Return a canvas with panels one above the other, by default on a common time axis.

    Args:
        count: Number of panels.
        height: Height of one panel [inches].
        common_time: Whether all have time as their horizontal axis.

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
        panel: Panel to draw in.
        time: Times [s], shape (samples,).
        values: Values in the panel's unit, shape (samples, dim).
        labels: One per column.
        style: Line style.
    """
    for index, (column, label) in enumerate(zip(np.asarray(values).T, labels, strict=True)):
        panel.plot(time, column, style, color=COLOURS[index % len(COLOURS)], label=label)


def draw_reference(panel: "Axes", time: ArrayLike, values: ArrayLike, label: str) -> None:
    """Draws the columns of a reference as wide, pale lines, each in its component's colour.

    Args:
        panel: Panel to draw in, before the signal that follows the reference.
        time: Times [s], shape (samples,).
        values: Values in the panel's unit, shape (samples, dim).
        label: One entry of the legend for all columns, in grey.
    """
    for index, column in enumerate(np.asarray(values).T):
        panel.plot(time, column, **BROAD | {"color": COLOURS[index % len(COLOURS)], "alpha": 0.3})
    add_entry(panel, label, **BROAD)


def add_entry(panel: "Axes", label: str, **line: Any) -> None:
    """Add one legend entry for several lines.

    Args:
        panel: The panel.
        label: Text of the entry.
        line: Properties of its line, as in matplotlib.
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
    """Shade the times at which a condition holds, from sample to sample.

    Gaps too small for a screen are shaded, too: a flickering condition has as many intervals as
    samples.

    Args:
        panels: Panels to shade; the first gets an entry in the legend.
        time: Times [s], shape (samples,).
        where: Condition, bool, shape (samples,).
        label: Name of the condition.
        colour: Colour of the shade.
        hatch: Pattern, if colour alone is ambiguous.
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
    """Return the starts and ends [s] of intervals with visible gaps, shape (intervals, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(where, dtype=int), [0]])))
    if not edges.size:
        return np.zeros((0, 2))
    begins, ends = time[edges[::2]], time[np.minimum(edges[1::2], len(time) - 1)]
    visible = begins[1:] - ends[:-1] > (time[-1] - time[0]) / (WIDTH * DPI)
    return np.column_stack([begins[np.r_[True, visible]], ends[np.r_[visible, True]]])


def late_samples(time: FloatArray) -> NDArray[np.bool_]:
    """Return a flag for each sample in the last three quarters of a run, shape (samples,).

    Args:
        time: Times [s], shape (samples,).
    """
    return np.asarray(time >= time[0] + 0.25 * (time[-1] - time[0]))


def scale_to_late(panel: "Axes", time: FloatArray, values: FloatArray) -> None:
    """Scales a panel, zero in the middle, to the last three quarters of its signals.

    Args:
        panel: Panel to scale.
        time: Times [s], shape (samples,).
        values: Values in the panel's unit, shape (samples, dim).
    """
    span = 1.2 * largest(values[late_samples(time)])
    if span > 0.0:
        panel.set_ylim(-span, span)


def is_dwarfed(time: FloatArray, values: FloatArray, ratio: float = 1.2) -> bool:
    """Return whether the last quarters of a run are much smaller than the first one.

    Args:
        time: Times [s], shape (samples,).
        values: Values in any unit, shape (samples, dim).
        ratio: Ratio of the largest magnitudes from which on they are.
    """
    return 0.0 < ratio * largest(values[late_samples(time)]) < largest(values)


def largest(values: FloatArray) -> float:
    """Return the largest finite magnitude, 0 if there is none.

    Args:
        values: Any shape.
    """
    return float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))


def fitting_unit(values: FloatArray, unit: str) -> tuple[float, str]:
    """Return milli, or micro if milli would leave nothing but decimals.

    Args:
        values: Any shape, in ``unit``.
        unit: Unit of the values.

    Returns:
        Factor from ``unit`` to the unit of the axis, and its name.
    """
    rounding_error = 1e-3 * _ROUNDING
    micro = rounding_error < largest(values) < MICRO_BELOW
    return (1e6, f"µ{unit}") if micro else (1e3, f"m{unit}")


def add_legend(panel: "Axes", columns: int | None = None) -> None:
    """Add a legend above the panel's right end, or above its title if both are long.

    Args:
        panel: Panel with title and lines.
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
    """Return the width of a line of text [points]."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    if not text:
        return 0.0
    font = FontProperties(weight=weight)
    return float(TextPath((0.0, 0.0), text, size=size, prop=font).get_extents().width)


def flatten_rounding_errors(panel: "Axes") -> None:
    """Scale a panel whose values are rounding errors so that they are drawn as zero.

    Args:
        panel: Panel with a linear vertical axis.
    """
    low, high = panel.get_ylim()
    if panel.get_yscale() == "linear" and max(abs(low), abs(high)) < _ROUNDING:
        panel.set_ylim(-1.0, 1.0)


def render(drawing: Drawing) -> Figure:
    """Return the image of a drawing; rounding errors in it are drawn as zero."""
    for panel in drawing.canvas.axes:
        flatten_rounding_errors(panel)
    drawing.canvas.align_ylabels()
    picture = BytesIO()
    drawing.canvas.savefig(picture, format="png", dpi=DPI, facecolor="white")
    return Figure(drawing.name, drawing.title, drawing.caption, picture.getvalue())
