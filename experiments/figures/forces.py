"""Forces on the tool: along the path's coordinates, in the world, as measured, and in pressing."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from numpy.typing import NDArray

from experiments.results.path import TOUCHING, force_error, held_samples
from experiments.results.posture import PUSHED, push_size
from experiments.results.run_log import FloatArray, RunLog
from reporting.style import (
    BROAD,
    COLOURS,
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
BAND = 2.0  # N, to either side of the reference
_SIZE = (7.0, 4.6)  # inches
_DOT = 7.0  # points^2


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


def has_varying_damping(log: RunLog) -> bool:
    """Whether the log has a damping along a path that varies."""
    return bool(np.ptp(log["damping"].values[:, 0]) > 0.0)


def draw_damping(log: RunLog) -> Drawing:
    """Damping of the tangential coordinate over the arc length, wherever the tool was."""
    eta, damping = log["eta"].values[:, 0], log["damping"].values[:, 0]
    order = np.argsort(eta)
    canvas, (panel,) = make_panels(1, height=2.6, common_time=False)
    panel.plot(eta[order], 1e-3 * damping[order], color=COLOURS[0])
    panel.set(xlabel=r"$\eta$ in m", ylabel="damping in kNs/m", ylim=(0.0, None))
    panel.set_title(r"Damping $d_\parallel$ over the arc length")
    caption = (
        f"Damping of the impedance along the path where the tool was, {damping.min():.3g} to "
        f"{damping.max():.4g} Ns/m."
    )
    return Drawing("damping", "Damping along the path", caption, canvas)


def draw_pressing(log: RunLog) -> Drawing:
    """Force along the workpiece's normal with its reference, its error, and what xi does for it."""
    time, force = log.time, log["normal_force"].values[:, 0]
    is_pressed = "press" in log
    canvas, panels = make_panels(3 if is_pressed else 2, height=2.4)
    upper, lower = panels[0], panels[-1]
    if is_pressed:
        press = log["press"].values[:, 0]
        upper.plot(time, press, label="reference", **BROAD)
        _draw_error(panels[1], log)
    upper.plot(time, force, color=COLOURS[0], label="acting")
    upper.set(ylabel="force in N", title="Force along the workpiece's normal")
    lower.axhline(0.0, color=REFERENCE, linewidth=0.8, label="taught surface")
    lower.plot(time, 1e3 * log["xi"].values[:, 0], color=COLOURS[0], label="tool point")
    lower.set(ylabel=r"$\xi$ in mm", title="Distance from the taught surface")
    for panel in panels:
        if panel.get_legend_handles_labels()[1]:
            place_legend(panel)
    caption = (
        "Force with which the workpiece presses back along its normal, and the tool point's "
        "distance from where the surface was taught"
    )
    caption += f"; the band is {BAND:g} N to either side of the full force." if is_pressed else "."
    return Drawing("pressing", "Force on the workpiece", caption, canvas)


def draw_force_map(log: RunLog) -> Drawing:
    """Force along the normal over the workpiece, along the way of the tool on it."""
    force = log["normal_force"].values[:, 0]
    on = force > TOUCHING
    along, across = 1e3 * log["eta"].values[on].T
    canvas = Canvas(figsize=_SIZE)
    panel = canvas.subplots()
    dots = panel.scatter(along, across, c=force[on], s=_DOT, cmap="viridis", linewidths=0.0)
    if "press" in log:
        full = float(log["press"].values.max())
        dots.set_clim(full - BAND, full + BAND)
    canvas.colorbar(dots, ax=panel, label="force in N", extend="both")
    panel.set(xlabel=r"$\eta_1$ in mm", ylabel=r"$\eta_2$ in mm", aspect="equal")
    panel.set_title("Force along the normal over the workpiece")
    caption = "Force on the workpiece along the tool's way, over the tangential coordinates."
    return Drawing("force_map", "Force over the workpiece", caption, canvas)


def _draw_error(panel: Axes, log: RunLog) -> None:
    """Force error while the full force shall keep, in its band."""
    held = held_samples(log)
    error = np.where(held, force_error(log), np.nan)
    panel.axhspan(-BAND, BAND, color=REFERENCE, alpha=0.15, linewidth=0.0)
    panel.axhline(0.0, color=REFERENCE, linewidth=0.8)
    panel.plot(log.time, error, color=COLOURS[0])
    span = max(1.2 * BAND, 1.1 * float(np.nanmax(np.abs(error), initial=0.0)))
    panel.set(ylim=(-span, span), ylabel="error in N", title="Force error after touch-down")
