"""Forces on the tool over time: along the path's coordinates, in the world, and as measured."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from experiments.results.posture_metrics import PUSHED, push_size
from experiments.results.run_log import FloatArray, RunLog
from reporting.style import (
    INK,
    REFERENCE,
    Drawing,
    draw_components,
    largest,
    make_panels,
    place_legend,
    shade,
)

FORCE_SIGNALS = ("manifold_force", "wrench_ext", "wrench_measured")
LEVER = 1e-3  # m; moments below the largest force times this lever are noise and not drawn
PAUSE = 0.02  # share of a run, up to which a break counts as part of a push
_SYMBOLS = {
    "tau_par": r"$\tau_\parallel$",
    "tau_par_1": r"$\tau_{\parallel,1}$",
    "tau_par_2": r"$\tau_{\parallel,2}$",
    "tau_perp": r"$\tau_\perp$",
    "tau_cross": r"$\tau_\times$",
    **{f"tau_{axis}": rf"$\tau_{axis}$" for axis in "zyx"},
    **{f"f_{axis}": f"$f_{axis}$" for axis in "xyz"},
    **{f"mu_{axis}": rf"$\mu_{axis}$" for axis in "xyz"},
}


@dataclass
class _Row:
    """A panel: forces [N] or moments [Nm], and what they are compared with."""

    title: str
    unit: str
    values: FloatArray
    labels: list[str]
    acting: FloatArray | None = None


def has_forces(log: RunLog) -> bool:
    """Whether the log has forces on the tool that are not all zero."""
    return any(largest(log[name].values) > 0.0 for name in FORCE_SIGNALS if name in log)


def draw_forces(log: RunLog) -> Drawing:
    """Forces along the path's coordinates, the wrench that acts and is measured.

    Moments have panels of their own, where they are more than noise. The times at which the
    force sensor is not tared yet, or faulty, are shaded.
    """
    rows = [*_manifold_rows(log), *_wrench_rows(log)]
    canvas, panels = make_panels(len(rows), height=2.4)
    for panel, row in zip(panels, rows, strict=True):
        panel.axhline(0.0, color=REFERENCE, linewidth=0.8)
        draw_components(panel, log.time, row.values, row.labels)
        if row.acting is not None:  # on top, or noise would hide it
            for column, label in zip(row.acting.T, ["acting", "", ""], strict=True):
                panel.plot(log.time, column, "--", color=INK, linewidth=1.0, label=label or None)
        kind = "force" if row.unit == "N" else "moment"
        panel.set(ylabel=f"{kind} in {row.unit}", title=row.title)
    _shade_sensor(panels, log)
    for panel in panels:
        place_legend(panel)
    return Drawing("forces", "Forces on the tool", _caption(log), canvas)


def shade_pushes(panels: list[Axes], log: RunLog) -> None:
    """Shades the times at which a force acts on the tool, or on a link, where the log has it.

    Args:
        panels: To shade; the first gets an entry for the legend.
        log: Perhaps with ``wrench_ext`` and ``push_force``.
    """
    pushes = []
    if "wrench_ext" in log:
        on_tool = np.linalg.norm(log["wrench_ext"].values[:, :3], axis=1)
        pushes.append((on_tool, "tool pushed", "#DBEAFE"))
    if "push_force" in log:
        pushes.append((push_size(log), "link pushed", "#FEF3C7"))
    for force, label, colour in pushes:
        peak = largest(force)
        if peak > 0.0:
            pushed = _bridged(force >= PUSHED * peak, round(PAUSE * len(force)))
            shade(panels, log.time, pushed, label, colour)


def _bridged(where: NDArray[np.bool_], gap: int) -> NDArray[np.bool_]:
    """Fills gaps of up to so many samples between true ones."""
    filled, true = where.copy(), np.flatnonzero(where)
    steps = np.diff(true)
    for k in np.flatnonzero((steps > 1) & (steps <= gap + 1)):
        filled[true[k] : true[k + 1]] = True
    return filled


def _manifold_rows(log: RunLog) -> list[_Row]:
    """Generalized forces along (eta, xi) and moments along phi."""
    if "manifold_force" not in log:
        return []
    signal = log["manifold_force"]
    labels = [_SYMBOLS.get(label, label) for label in signal.labels]
    values = signal.values
    rows = [_Row("Force along the path's coordinates", "N", values[:, :3], labels[:3])]
    if _matters(values):
        title = "Moment along the orientation's coordinates"
        rows.append(_Row(title, "Nm", values[:, 3:], labels[3:]))
    return rows


def _wrench_rows(log: RunLog) -> list[_Row]:
    """The measured wrench over the one that acts, or the only one of them."""
    wrenches = [log[name] for name in ("wrench_measured", "wrench_ext") if name in log]
    if not wrenches:
        return []
    values = wrenches[0].values
    acting = wrenches[1].values if len(wrenches) == 2 else None
    labels = [_SYMBOLS.get(label, label) for label in wrenches[0].labels]
    verb = "measured" if "wrench_measured" in log else "acting"
    rows = [("Force", "N", slice(0, 3))]
    if any(_matters(wrench.values) for wrench in wrenches):
        rows.append(("Moment", "Nm", slice(3, 6)))
    return [
        _Row(
            f"{kind} {verb}, world axes",
            unit,
            values[:, part],
            labels[part],
            None if acting is None else acting[:, part],
        )
        for kind, unit, part in rows
    ]


def _matters(wrench: FloatArray) -> bool:
    """Whether the moments, after three forces, are more than noise."""
    return largest(wrench[:, 3:]) > LEVER * largest(wrench[:, :3])


def _shade_sensor(panels: list[Axes], log: RunLog) -> None:
    """Shades where the sensor is not tared, or faulty."""
    if "tared" in log:
        waiting = log["tared"].values[:, 0] == 0.0
        shade(panels, log.time, waiting, "sensor not tared", "#E5E7EB", "///")
    if "sensor_fault" in log:
        faulty = log["sensor_fault"].values[:, 0] != 0.0
        shade(panels, log.time, faulty, "sensor fault", "#FCA5A5")


def _caption(log: RunLog) -> str:
    """What the figure shows, by the signals that it has."""
    parts = []
    if "manifold_force" in log:
        parts.append("generalized forces along and across the path, as the controller sees them")
    if "wrench_measured" in log and "wrench_ext" in log:
        parts.append("the measured wrench and the one that acts at the tool point (dashed)")
    elif "wrench_measured" in log:
        parts.append("the wrench measured at the tool point")
    elif "wrench_ext" in log:
        parts.append("the wrench that acts at the tool point")
    text = "; ".join(parts)
    return f"{text[0].upper()}{text[1:]}."
