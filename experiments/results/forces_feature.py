"""Forces on the tool: in the world, as measured, along the path's coordinates, and in a notch.

Signals used, as in the log: ``manifold_force`` [samples, 3 or more], the first three in N along
the translational coordinates, ``tared`` [samples, 1] 0 or 1, ``wrench_ext`` [samples, 6] N and
Nm, ``notch_position`` [samples, 2] m.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from diagrams.scenario import Scenario, Target
from diagrams.station import Station
from experiments.results.feature import Feature, Raw, by_order
from experiments.results.pushes_feature import PUSHED, push_size
from experiments.results.run_log import FloatArray, RunLog, peak
from pfsc_drake.control.compliance.impedance import DAMPING, STIFFNESS
from pfsc_drake.robot.tool_load import joint_torque_function
from reporting import style
from reporting.metrics import Metrics

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# signals with the same name in a station's log and a run's
_AS_LOGGED = (
    *("wrench_ext", "wrench_measured", "wrench_sensor", "wrench_observed"),
    *("tared", "sensor_fault", "tau_ext_observed"),
)
# titles of forces and moments in a figure
_TITLES = {
    "manifold_force": (
        "Force along the path's coordinates",
        "Moment along the orientation's coordinates",
    ),
    "wrench_measured": ("Measured force, world axes", "Measured moment, world axes"),
    "wrench_ext": ("Actual force, world axes", "Actual moment, world axes"),
}
LEVER = 1e-3  # m; moments below the largest force times this lever are noise and not drawn
PAUSE = 0.02  # share of a run, up to which a gap counts as part of a push
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
_NOTCH_SIZE = 5.0  # inches
_MARGIN = 1.25  # of the picture, beyond the farthest point


def add_forces(log: RunLog, station: Station, raw: Raw) -> None:
    """Add actual and measured forces on the tool, impedance, and the ball's position in a notch.

    Args:
        log: Log of the run, which is extended.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    for name in _AS_LOGGED:
        if name in raw:
            log.add(name, raw[name])
    forces = [coordinate.force for coordinate in station.task.projected_manifold.coordinates]
    if "manifold_force" in raw:
        log.add("manifold_force", raw["manifold_force"], labels=forces)
    if "damping" in raw:
        labels = [name.replace("tau", "d", 1) for name in forces]
        log.add("damping", raw["damping"], labels=labels)
    if "wrench_ext" in raw or "push_torque" in raw:
        log.add("tau_ext", _joint_torques(station, raw))
    if "impedance" in raw:
        _add_impedance(log, station, raw)
    for name, length in station.further_lengths(raw["true_pose"][:, :3]).items():
        log.add(name, length.values, labels=length.labels, limits=length.limit)


def _add_impedance(log: RunLog, station: Station, raw: Raw) -> None:
    """Add the impedance that an operator has changed."""
    names = [coordinate.name for coordinate in station.task.projected_manifold.coordinates]
    impedance = by_order(raw["impedance"], len(names))
    log.add("stiffness", impedance[:, STIFFNESS], labels=names)
    log.add("damping", impedance[:, DAMPING], labels=names)
    log.add("tank", raw["tank"])


def _joint_torques(station: Station, raw: Raw) -> np.ndarray:
    """Return external forces on tool and links as joint torques, shape (samples, N)."""
    q_J = raw["joint_state"][:, : station.robot.dimension]
    pushes = raw.get("push_torque", np.zeros_like(q_J))
    if len(q_J) == 0 or "wrench_ext" not in raw:
        return pushes
    function = joint_torque_function(station.robot).map(len(q_J))
    return np.array(function(q_J.T, raw["wrench_ext"].T)).T + pushes


def force_metrics(log: RunLog) -> Metrics:
    """Return the metrics of forces on the tool whose signals a log has.

    Args:
        log: Log of a run.
    """
    metrics = Metrics()
    if "manifold_force" in log:
        along = log["eta"].dim if "eta" in log else 1
        tared = log["tared"].values[:, 0] != 0.0 if "tared" in log else slice(None)
        forces = log["manifold_force"].values[tared, :3]
        metrics.add("max_manifold_force", peak(np.linalg.norm(forces, axis=1)))
        metrics.add("max_tangential_force", peak(np.linalg.norm(forces[:, :along], axis=1)))
    if "wrench_ext" in log:
        acting = np.linalg.norm(log["wrench_ext"].values[:, :3], axis=1)
        metrics.add("max_external_force", peak(acting))
        if "tared" in log:
            unanswered = log["tared"].values[:, 0] == 0.0
            if "held" in log:  # the weight of a plate is known
                unanswered &= log["held"].values[:, 0] == 0.0
            metrics.add("max_unanswered_force", acting[unanswered].max(initial=0.0))
    if "notch_position" in log:
        metrics.add("max_distance_from_notch_axis", peak(log.norm("notch_position")))
    return metrics


def _requirements(settings: Scenario) -> dict[str, Target]:
    """Require that forces on an untared sensor are below the threshold of taring."""
    if not settings.compliance.needs_sensor:
        return {}
    spread = settings.sensor.taring_spread[:3].max()
    return {"max_unanswered_force": Target(f"<= {spread:g}", "sensor.taring_spread")}


def _sensor_warnings(log: RunLog) -> list[str]:
    """Return a warning if a force sensor was never tared."""
    if "tared" not in log or log["tared"].values.any() or not log.time.size:
        return []
    return [
        "the force/torque sensor was never tared: the reference did not comply, and metrics of "
        "compliance do not count; the sensor's residual did not remain within sensor.taring_spread "
        "for "
        "sensor.taring_time, or its mean was above sensor.taring_bias"
    ]


def has_forces(log: RunLog) -> bool:
    """Return whether the log has forces on the tool that are not all zero."""
    return any(style.largest(log[name].values) > 0.0 for name in _TITLES if name in log)


def draw_forces(log: RunLog) -> style.Drawing | None:
    """Draw forces along the path's coordinates, and the actual and measured wrench.

    Moments above noise have separate panels. Times with an untared or faulty force sensor are
    shaded.
    """
    if not has_forces(log):
        return None
    shown: list[tuple[str, str, slice]] = []
    for name, (force, moment) in _TITLES.items():
        if name in log and not (name == "wrench_ext" and "wrench_measured" in log):
            shown.append((name, force, slice(0, 3)))
            also = ("wrench_ext",) if name == "wrench_measured" and "wrench_ext" in log else ()
            if any(_has_moments(log[x].values) for x in (name, *also)):
                shown.append((name, moment, slice(3, None)))
    canvas, panels = style.make_panels(len(shown), height=2.4)
    for panel, (name, title, part) in zip(panels, shown, strict=True):
        labels = [_SYMBOLS.get(label, label) for label in log[name].labels[part]]
        panel.axhline(0.0, color=style.REFERENCE, linewidth=0.8)
        style.draw_components(panel, log.time, log[name].values[:, part], labels)
        if name == "wrench_measured" and "wrench_ext" in log:  # on top, or noise would hide it
            acting = panel.plot(log.time, log["wrench_ext"].values[:, part], "--", linewidth=1.0)
            for line in acting:
                line.set_color(style.INK)
            acting[0].set_label("actual")
        kind, unit = ("force", "N") if part.start == 0 else ("moment", "Nm")
        panel.set(ylabel=f"{kind} in {unit}", title=title)
    _shade_sensor(panels, log)
    for panel in panels:
        style.add_legend(panel)
    return style.Drawing("forces", "Forces on the tool", _caption(log), canvas)


def shade_pushes(panels: "list[Axes]", log: RunLog) -> None:
    """Shade the times of forces on the tool or a link, if the log has them.

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
        peak = style.largest(force)
        if peak > 0.0:
            pushed = _bridged(force >= PUSHED * peak, round(PAUSE * len(force)))
            style.shade(panels, log.time, pushed, label, colour)


def _bridged(where: NDArray[np.bool_], gap: int) -> NDArray[np.bool_]:
    """Fill gaps of up to a number of samples between true ones."""
    filled, true = where.copy(), np.flatnonzero(where)
    steps = np.diff(true)
    for k in np.flatnonzero((steps > 1) & (steps <= gap + 1)):
        filled[true[k] : true[k + 1]] = True
    return filled


def _has_moments(wrench: FloatArray) -> bool:
    """Return whether the moments in a wrench exceed noise."""
    return style.largest(wrench[:, 3:]) > LEVER * style.largest(wrench[:, :3])


def _shade_sensor(panels: "list[Axes]", log: RunLog) -> None:
    """Shade the times of an untared or faulty sensor."""
    if "tared" in log:
        waiting = log["tared"].values[:, 0] == 0.0
        style.shade(panels, log.time, waiting, "sensor not tared", "#E5E7EB", "///")
    if "sensor_fault" in log:
        faulty = log["sensor_fault"].values[:, 0] != 0.0
        style.shade(panels, log.time, faulty, "sensor fault", "#FCA5A5")


def _caption(log: RunLog) -> str:
    """Return the caption for the available signals."""
    parts = []
    if "manifold_force" in log:
        parts.append("generalized forces along and across the path, as measured by the controller")
    if "wrench_measured" in log and "wrench_ext" in log:
        parts.append("measured and actual wrench at the tool point (dashed: actual)")
    elif "wrench_measured" in log:
        parts.append("measured wrench at the tool point")
    elif "wrench_ext" in log:
        parts.append("actual wrench at the tool point")
    text = "; ".join(parts)
    return f"{text[0].upper()}{text[1:]}."


def draw_damping(log: RunLog) -> style.Drawing | None:
    """Draw damping of the tangential coordinate over the arc length."""
    eta, damping = log["eta"].values[:, 0], log["damping"].values[:, 0]
    if np.ptp(damping) == 0.0:
        return None
    order = np.argsort(eta)
    canvas, (panel,) = style.make_panels(1, height=2.6, common_time=False)
    panel.plot(eta[order], 1e-3 * damping[order], color="C0")
    panel.set(xlabel=r"$\eta$ in m", ylabel="damping in kNs/m", ylim=(0.0, None))
    panel.set_title(r"Damping $d_\parallel$ over the arc length")
    caption = (
        f"Damping of the impedance along the path, {damping.min():.3g} to {damping.max():.4g} Ns/m."
    )
    return style.Drawing("damping", "Damping along the path", caption, canvas)


def draw_notch_position(log: RunLog) -> style.Drawing:
    """Draw the motion of the ball's centre in the notch, with the circle free of contact."""
    signal = log["notch_position"]
    left, above = 1e3 * signal.values.T
    canvas = style.make_canvas(_NOTCH_SIZE, _NOTCH_SIZE)
    panel = canvas.subplots()
    panel.plot(-left, above, color="C0", linewidth=1.0, label="centre of the ball")
    panel.plot(-left[:1], above[:1], "o", color="C2", label="start")
    reach = float(np.nanmax(np.abs(signal.values))) * 1e3
    if signal.limits is not None:
        free = 1e3 * float(np.max(signal.limits))
        angle = np.linspace(0.0, 2.0 * np.pi, 181)
        panel.plot(
            free * np.cos(angle),
            free * np.sin(angle),
            "--",
            color=style.INK,
            label="free of contact",
        )
        reach = max(reach, free)
    for draw_axis in (panel.axhline, panel.axvline):
        draw_axis(0.0, color=style.REFERENCE, linewidth=0.8)
    span = _MARGIN * reach
    panel.set(xlim=(-span, span), ylim=(-span, span), aspect="equal")
    panel.set(xlabel="to the right of the notch's axis in mm", ylabel="above it in mm")
    panel.set_title("Ball in the notch, view along the path")
    panel.legend(loc="upper right")
    return style.Drawing(
        "notch",
        "Ball in the notch",
        "Centre of the ball in the cross-section of the notch; outside the dashed circle its soft "
        "shell is in contact.",
        canvas,
    )


FEATURE = Feature(
    signals=add_forces,
    metrics=lambda log, station, settings: force_metrics(log),
    requirements=_requirements,
    always=("max_unanswered_force",),
    warnings=lambda log, station, settings: _sensor_warnings(log),
    figures={"forces": draw_forces, "damping": draw_damping, "notch": draw_notch_position},
)
