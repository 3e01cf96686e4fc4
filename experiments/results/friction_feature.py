"""Friction of the drives, its estimate, and coefficients and momenta of the estimation."""

import numpy as np

from diagrams.station import Station
from experiments.results.drives_feature import EFFORTS, effort_label
from experiments.results.feature import Feature, Raw
from experiments.results.joints_feature import MOVERS
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.estimation.momentum import drive_momentum
from reporting import style
from reporting.metrics import Metrics

_COEFFICIENTS = {"f_c": "coulomb", "f_v": "viscous"}
AT_REST = 0.01  # share of an axis' largest velocity, below which it counts as at rest
_SMALLEST_SPAN = 2.0  # %, of the axis of relative errors
_TOGETHER = 3  # axes whose momenta share a panel


def add_friction(log: RunLog, station: Station, raw: Raw) -> None:
    """Add friction, its estimate, and momenta and coefficients of an estimation.

    Args:
        log: Log of the run.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    if "friction_torque" in raw:
        log.add("tau_f", raw["friction_torque"])
    if "friction_estimate" not in raw:
        return
    estimate, axes = raw["friction_estimate"], station.robot.dimension
    parts = np.split(estimate, estimate.shape[1] // axes, axis=1)
    names = ("friction_estimate", "f_c_estimate", "f_v_estimate")
    for name, part in zip(names, parts, strict=False):
        log.add(name, part)
    if len(parts) == 1:
        return
    if "tau_f" in log:
        friction = station.diagram.GetSubsystemByName("joint_friction")
        for name, values in zip(("f_c", "f_v"), friction.coefficients(log.time), strict=True):
            log.add(name, values)
    log.add("momentum", _momentum(station, raw["joint_state"]))


def friction_metrics(log: RunLog) -> Metrics:
    """Return the metrics of friction whose signals the log has.

    Errors of coefficients refer to the last sample, for each axis and the worst axis.
    """
    metrics = Metrics()
    if log.time.size == 0:
        return metrics
    if "friction_estimate" in log and "tau_f" in log:
        error = log["friction_estimate"].values - log["tau_f"].values
        for axis, rms in enumerate(np.sqrt(np.mean(error**2, axis=0)), start=1):
            metrics.add(f"rms_friction_error_{axis}", float(rms), log["tau_f"].unit)
    for name, kind in _COEFFICIENTS.items():
        if f"{name}_estimate" not in log or name not in log:
            continue
        errors = np.abs(relative_errors(log, name)[-1])
        metrics.add(f"max_{kind}_error", float(np.nanmax(errors, initial=0.0)))
        for axis, value in enumerate(errors, start=1):
            metrics.add(f"{kind}_error_{axis}", float(value))
    return metrics


def relative_errors(log: RunLog, name: str) -> FloatArray:
    """Return relative errors of estimated coefficients, shape (samples, axes).

    NaN without such friction.

    Args:
        log: With estimated and actual coefficients.
        name: ``f_c`` or ``f_v``.
    """
    estimate, truth = log[f"{name}_estimate"].values, log[name].values
    return np.asarray(estimate / np.where(truth > 0.0, truth, np.nan) - 1.0)


def _momentum(station: Station, state: FloatArray) -> FloatArray:
    """Return the generalized momenta ``D(q) q'`` of App. A, shape (samples, N)."""
    if len(state) == 0:
        return np.zeros((0, station.robot.dimension))
    function = drive_momentum(station.robot).function.map(len(state))
    return np.array(function(state.T)[0]).T


def draw_friction(log: RunLog) -> style.Drawing:
    """Draw friction and velocity of each drive; both axes share their zero."""
    friction = log["tau_f"]
    motors = "v_M" in log
    velocity = log["v_M" if motors else "v_J"]
    mover = "motor" if motors else MOVERS.get(velocity.unit, "joint or slide")
    word = EFFORTS.get(friction.unit, "torque or force")
    canvas, panels = style.make_panels(friction.dim, height=2.0)
    for axis, panel in enumerate(panels):
        v, tau_f = velocity.values[:, axis], friction.values[:, axis]
        right = panel.twinx()
        right.fill_between(log.time, v, color="#9CA3AF", alpha=0.35, linewidth=0.0)
        right.plot(log.time, v, color=style.REFERENCE, linewidth=1.0)
        right.set(ylabel=f"{mover} velocity\nin {velocity.unit}")
        right.grid(visible=False)
        right.spines["right"].set_visible(True)
        # the twin axis is drawn above; friction must be on top
        panel.set_zorder(right.get_zorder() + 1)
        panel.patch.set_visible(False)
        panel.plot(log.time, tau_f, color="C1", label=f"friction {word} (left)")
        panel.plot([], [], color=style.REFERENCE, linewidth=1.0, label=f"{mover} velocity (right)")
        style.shade(
            [panel],
            log.time,
            np.abs(v) < AT_REST * style.largest(v),
            "nearly at rest",
            "#FDE9C4",
        )
        for axes, values in ((panel, tau_f), (right, v)):
            span = 1.15 * style.largest(values)
            if span > 0.0:
                axes.set_ylim(-span, span)
        panel.set(ylabel=effort_label(friction.unit), title=f"Axis {axis + 1}")
    style.add_legend(panels[0])
    caption = (
        f"Friction and velocity of the drives. Below {100 * AT_REST:g} % of its largest speed a "
        "drive"
        f" sticks: the friction {word} changes sign without motion."
    )
    return style.Drawing("friction", "Friction of the drives", caption, canvas)


def draw_friction_estimate(log: RunLog) -> style.Drawing:
    """Draw actual and estimated friction of each drive."""
    friction, estimate = log["tau_f"], log["friction_estimate"]
    word = {"Nm": "torque in Nm", "N": "force in N"}.get(friction.unit, "torque or force")
    canvas, panels = style.make_panels(friction.dim, height=1.9)
    for axis, panel in enumerate(panels):
        panel.plot(log.time, friction.values[:, axis], label="actual", **style.BROAD)
        panel.plot(log.time, estimate.values[:, axis], color="C1", label="estimate")
        span = 1.4 * float(np.max(np.abs(friction.values[:, axis]), initial=0.0))
        if span > 0.0:
            panel.set_ylim(-span, span)
        panel.set(ylabel=word, title=f"Axis {axis + 1}")
    style.add_legend(panels[0])
    caption = "Friction of the drives: actual value, and the controller's estimate."
    return style.Drawing("friction_estimate", "Estimated friction", caption, canvas)


def draw_friction_coefficients(log: RunLog) -> style.Drawing:
    """Draw momenta, and estimated coefficients relative to the actual ones (Fig. A.1)."""
    momentum = log["momentum"]
    shares = _shares(momentum.dim)
    canvas, panels = style.make_panels(len(shares) + 2, height=2.4)
    for panel, axes in zip(panels, shares, strict=False):
        for axis in axes:
            label = rf"$p_{axis + 1}$"
            panel.plot(log.time, momentum.values[:, axis], color=_colour(axis), label=label)
        title = "Generalized momenta $p$" if axes[0] == 0 else "Momenta of the last axes"
        panel.set(ylabel=f"momentum in {momentum.unit}", title=title)
        style.add_legend(panel)
    kinds = {"f_c": "Coulomb friction $f_c$", "f_v": "Viscous friction $f_v$"}
    for panel, (name, title) in zip(panels[-2:], kinds.items(), strict=True):
        values = 100.0 * (1.0 + relative_errors(log, name))
        labels = [f"axis {i + 1}" for i in range(values.shape[1])]
        panel.axhline(100.0, color=style.REFERENCE, linewidth=0.8)
        panel.axhspan(98.0, 102.0, color=style.REFERENCE, alpha=0.15, linewidth=0.0)
        style.draw_components(panel, log.time, values, labels)
        late = values[log.time >= log.time[-1] / 10.0] - 100.0
        span = max(1.1 * float(np.nanmax(np.abs(late), initial=0.0)), _SMALLEST_SPAN)
        panel.set_ylim(100.0 - span, 100.0 + span)
        panel.set(ylabel="estimate in %\nof actual value", title=title)
    style.add_legend(panels[-2])
    caption = (
        "Generalized momenta, the input of the estimation, and estimated coefficients relative to"
        " the actual ones; grey band: 2 % to either side."
    )
    return style.Drawing(
        "friction_coefficients", "Estimated coefficients of friction", caption, canvas
    )


def _shares(axes: int) -> list[range]:
    """Return the axes of each panel of momenta; small ones near the tool have their own panel."""
    half = (axes + 1) // 2
    return [range(axes)] if axes <= _TOGETHER else [range(half), range(half, axes)]


def _colour(axis: int) -> str:
    return f"C{axis}"


FEATURE = Feature(
    signals=add_friction,
    metrics=lambda log, station, settings: friction_metrics(log),
    # an observer is optional
    known=lambda station, settings: (
        *("tau_f", "friction_estimate", "f_c", "f_c_estimate", "f_v", "f_v_estimate"),
    ),
    figures={
        "friction": draw_friction,
        "friction_estimate": draw_friction_estimate,
        "friction_coefficients": draw_friction_coefficients,
    },
)
