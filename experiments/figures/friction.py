"""What is thought of friction over time, beside what is true."""

import numpy as np

from experiments.results.friction import relative_errors
from experiments.results.run_log import RunLog
from reporting.style import (
    BROAD,
    COLOURS,
    REFERENCE,
    Drawing,
    draw_components,
    make_panels,
    place_legend,
)

_SMALLEST_SPAN = 2.0  # %, of the axis of relative errors
_TOGETHER = 3  # axes whose momenta share a panel


def draw_friction_estimate(log: RunLog) -> Drawing:
    """Friction of each drive, and what the controller takes it for."""
    friction, estimate = log["tau_f"], log["friction_estimate"]
    word = {"Nm": "torque in Nm", "N": "force in N"}.get(friction.unit, "torque or force")
    canvas, panels = make_panels(friction.dim, height=1.9)
    for axis, panel in enumerate(panels):
        panel.plot(log.time, friction.values[:, axis], label="true", **BROAD)
        panel.plot(log.time, estimate.values[:, axis], color=COLOURS[1], label="estimate")
        span = 1.4 * float(np.max(np.abs(friction.values[:, axis]), initial=0.0))
        if span > 0.0:
            panel.set_ylim(-span, span)
        panel.set(ylabel=word, title=f"Axis {axis + 1}")
    place_legend(panels[0])
    caption = "What the controller takes for friction of the drives, and what it is."
    return Drawing("friction_estimate", "Estimated friction", caption, canvas)


def draw_friction_coefficients(log: RunLog) -> Drawing:
    """Momenta, and the coefficients estimated from them in units of the true ones (Fig. A.1)."""
    momentum = log["momentum"]
    shares = _shares(momentum.dim)
    canvas, panels = make_panels(len(shares) + 2, height=2.4)
    for panel, axes in zip(panels, shares, strict=False):
        for axis in axes:
            label = rf"$p_{axis + 1}$"
            panel.plot(log.time, momentum.values[:, axis], color=_colour(axis), label=label)
        title = "Generalized momenta $p$" if axes[0] == 0 else "Those of the last axes"
        panel.set(ylabel=f"momentum in {momentum.unit}", title=title)
        place_legend(panel)
    kinds = {"f_c": "Coulomb friction $f_c$", "f_v": "Viscous friction $f_v$"}
    for panel, (name, title) in zip(panels[-2:], kinds.items(), strict=True):
        values = 100.0 * (1.0 + relative_errors(log, name))
        labels = [f"axis {i + 1}" for i in range(values.shape[1])]
        panel.axhline(100.0, color=REFERENCE, linewidth=0.8)
        panel.axhspan(98.0, 102.0, color=REFERENCE, alpha=0.15, linewidth=0.0)
        draw_components(panel, log.time, values, labels)
        late = values[log.time >= log.time[-1] / 10.0] - 100.0
        span = max(1.1 * float(np.nanmax(np.abs(late), initial=0.0)), _SMALLEST_SPAN)
        panel.set_ylim(100.0 - span, 100.0 + span)
        panel.set(ylabel="estimate in %\nof the true one", title=title)
    place_legend(panels[-2])
    caption = (
        "Momenta on which friction acts, from which it is estimated, and the estimated coefficients"
        " in units of the true ones; the band is 2 % wide to either side."
    )
    return Drawing("friction_coefficients", "Estimated coefficients of friction", caption, canvas)


def _shares(axes: int) -> list[range]:
    """Axes of each panel of momenta: those next to the tool have too little to be seen."""
    half = (axes + 1) // 2
    return [range(axes)] if axes <= _TOGETHER else [range(half), range(half, axes)]


def _colour(axis: int) -> str:
    return COLOURS[axis % len(COLOURS)]
