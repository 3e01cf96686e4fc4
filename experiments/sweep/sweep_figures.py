"""Figures of a sweep: the metric over each varied parameter, and its histogram."""

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from experiments.sweep.influence import find_influence
from experiments.sweep.summary import Columns, Spread
from experiments.sweep.worker import COMPLETED
from reporting.metrics import format_quantity
from reporting.style import ALERT, COLOURS, INK, REFERENCE, STYLE, WIDTH, Drawing, Figure, render

MAX_PANELS = 12

_COLUMNS, _PANEL_HEIGHT = 3, 2.7
# largest number of values with a tick each
_FEW = 8
_WIDE = 30.0  # ratio of largest and smallest value, above which the scale is logarithmic
# ratio of largest value and median of a parameter, above which its scale is logarithmic
_CROWDED = 5.0
_SCALES = {"m": (1e3, "mm"), "rad": (1e3, "mrad"), "s": (1.0, "s")}
_MICRO = 1e-4  # m or rad
_CROSS_HEIGHT = 0.97  # of a panel


def draw_sweep(spread: Spread, columns: Columns, varied: Sequence[str]) -> list[Figure]:
    """Draw the figures of a sweep.

    Args:
        spread: Spread of the metric to draw.
        columns: The table.
        varied: Columns of varied parameters.
    """
    ended_otherwise = sum(status != COMPLETED for status in columns["status"])
    return [
        _over_parameters(spread, columns, varied, ended_otherwise),
        _histogram(spread, ended_otherwise),
    ]


def _over_parameters(
    spread: Spread, columns: Columns, varied: Sequence[str], ended_otherwise: int
) -> Figure:
    scale, label = _axis(spread)
    values = np.array([np.nan if v is None else v for v in columns[spread.name]], dtype=float)
    values[[status != COMPLETED for status in columns["status"]]] = np.nan
    influence = {name: find_influence(columns[name], values) for name in varied}
    kind = next((name for name in varied if _is_kind(columns[name])), None)
    groups = _kinds(columns[kind]) if kind else []
    colours = [COLOURS[groups.index(str(v))] for v in columns[kind]] if kind else []
    colours = colours or [COLOURS[0]] * len(values)
    chosen = sorted(varied, key=lambda name: -influence[name].strength)[:MAX_PANELS]
    across = min(len(chosen), _COLUMNS)
    down = -(-len(chosen) // across)
    with plt.rc_context(STYLE):
        canvas = Canvas(figsize=(WIDTH, max(3.4, _PANEL_HEIGHT * down)))
        panels = canvas.subplots(down, across, sharey=True, squeeze=False)
        for panel, name in zip(panels.flat, chosen, strict=False):
            _draw_parameter(panel, name, columns[name], values * scale, colours)
            worst = columns["run"].index(spread.worst_run)
            panel.plot(
                _positions(columns[name])[worst],
                spread.worst * scale,
                "o",
                markersize=10,
                markerfacecolor="none",
                markeredgecolor=ALERT,
            )
            panel.set_title(str(influence[name]))
            if (bend := influence[name].bend) is not None:
                panel.axvline(bend, color=REFERENCE, linestyle="--", linewidth=1.0, zorder=0)
        for panel in panels.flat[len(chosen) :]:
            panel.set_visible(False)
        for row in panels:
            row[0].set_ylabel(label)
        if _is_wide(spread):
            panels[0, 0].set_yscale("log")
        caption = (
            f"{_spoken(spread)} of every run over varied parameters, the most influential first."
        )
        if bends := [
            f"{influence[n]} of {_short(n)}" for n in chosen if influence[n].bend is not None
        ]:
            caption += f" Extrema (dashed): {'; '.join(bends)}."
        if groups:
            marks = [Line2D([], [], color=colour, marker="o", linestyle="") for colour in COLOURS]
            labels = [_short(group) for group in groups]
            canvas.legend(marks[: len(groups)], labels, loc="outside upper right", ncols=4)
        if len(chosen) < len(varied):
            caption += f" {len(varied) - len(chosen)} more parameters are in the table."
        caption += f" Ring: the worst, run {spread.worst_run}."
        if ended_otherwise:
            caption += " Crosses at the top: runs that did not complete."
        return render(Drawing("parameters", f"{_spoken(spread)} over parameters", caption, canvas))


def _draw_parameter(
    panel: Axes,
    name: str,
    parameter: list[Any],
    values: NDArray[Any],
    colours: Sequence[str],
) -> None:
    positions, there = _positions(parameter), np.isfinite(values)
    size = float(np.clip(60.0 / np.sqrt(len(values)), 2.0, 7.0))
    panel.scatter(
        positions[there],
        values[there],
        s=size**2,
        c=np.array(colours)[there],
        edgecolors="none",
        alpha=0.65,
    )
    panel.plot(
        positions[~there],
        [_CROSS_HEIGHT] * int((~there).sum()),
        "x",
        color=ALERT,
        markersize=6,
        transform=panel.get_xaxis_transform(),
    )
    panel.set_xlabel(_short(name), fontsize=9)
    panel.margins(x=0.06)
    if not _is_numeric(parameter):
        kinds = _kinds(parameter)
        texts = [_short(kind, 20) for kind in kinds]
        panel.set_xticks(range(len(kinds)), texts, rotation=20 if len(kinds) > 2 else 0)
        panel.set_xlim(-0.5, len(kinds) - 0.5)
        return
    numbers = np.array(parameter, dtype=float)
    ticks = np.unique(numbers)
    if numbers.min() > 0.0 and np.median(numbers) < numbers.max() / _CROWDED:
        panel.set_xscale("log")
    elif len(set(parameter)) <= _FEW and np.diff(ticks).min(initial=np.inf) > np.ptp(ticks) / _FEW:
        panel.set_xticks(ticks, [f"{tick:.4g}" for tick in ticks])
    else:
        panel.xaxis.set_major_locator(MaxNLocator(4))


def _histogram(spread: Spread, ended_otherwise: int) -> Figure:
    scale, label = _axis(spread)
    values = spread.values * scale
    with plt.rc_context(STYLE):
        canvas = Canvas(figsize=(WIDTH, 3.6))
        panel = canvas.subplots()
        bins: Any = int(np.clip(2.0 * np.sqrt(len(values)), 5, 60))
        if _is_wide(spread):
            bins = np.geomspace(values.min(), values.max(), bins + 1)
            panel.set_xscale("log")
        panel.hist(values, bins=bins, color=COLOURS[5], edgecolor="white", linewidth=0.6)
        panel.yaxis.set_major_locator(MaxNLocator(integer=True))
        marks = [
            ("median", spread.quantile(0.5), INK, ":"),
            ("99 % quantile", spread.quantile(0.99), COLOURS[1], "--"),
            (f"worst, run {spread.worst_run}", spread.worst, ALERT, "-"),
        ]
        for name, value, colour, style in marks:
            text = f"{name}: {format_quantity(value, spread.unit)}"
            panel.axvline(value * scale, color=colour, linestyle=style, label=text)
        panel.set(xlabel=label, ylabel="runs")
        panel.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3)
        caption = f"{_spoken(spread)} of the {len(values)} runs that completed."
        if ended_otherwise:
            caption += f" {ended_otherwise} did not, and are not in the quantiles."
        return render(Drawing("histogram", f"{_spoken(spread)}, histogram", caption, canvas))


def _positions(parameter: list[Any]) -> NDArray[Any]:
    """Return the positions of a parameter's values on its axis."""
    if _is_numeric(parameter):
        return np.array(parameter, dtype=float)
    kinds = _kinds(parameter)
    return np.array([kinds.index(str(value)) for value in parameter], dtype=float)


def _kinds(parameter: list[Any]) -> list[str]:
    return list(dict.fromkeys(str(value) for value in parameter))


def _is_kind(parameter: list[Any]) -> bool:
    """Return whether a parameter divides the runs into a few kinds, distinguished by colour."""
    return not _is_numeric(parameter) and 1 < len(_kinds(parameter)) <= len(COLOURS)


def _is_numeric(parameter: list[Any]) -> bool:
    return all(isinstance(value, (int, float)) for value in parameter)


def _is_wide(spread: Spread) -> bool:
    """Return whether the values need a logarithmic scale."""
    low, high = float(spread.values.min()), float(spread.values.max())
    return low > 0.0 and high > _WIDE * low


def _axis(spread: Spread) -> tuple[float, str]:
    """Return the factor to the unit of the axis, and its label."""
    scale, unit = _SCALES.get(spread.unit, (1.0, spread.unit))
    if scale == 1e3 and 0.0 < np.abs(spread.values).max() < _MICRO:
        scale, unit = 1e6, f"µ{spread.unit}"
    name = spread.name.replace("_", " ")
    return scale, name if unit == "1" else f"{name} in {unit}"


def _spoken(spread: Spread) -> str:
    words = spread.name.replace("_", " ")
    return words[:1].upper() + words[1:]


def _short(text: str, length: int = 38) -> str:
    """Return a text shortened at its beginning, since its end is more specific."""
    return text if len(text) <= length else f"...{text[3 - length :]}"
