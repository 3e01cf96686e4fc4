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

# what stands in a station's log as in that of a run
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
    "wrench_measured": ("Force measured, world axes", "Moment measured, world axes"),
    "wrench_ext": ("Force acting, world axes", "Moment acting, world axes"),
}
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
_NOTCH_SIZE = 5.0  # inches
_MARGIN = 1.25  # of the picture, beyond the farthest point


def add_forces(log: RunLog, station: Station, raw: Raw) -> None:
    """Add forces on the tool, as they act and as measured, impedance, and the ball in a notch.

    Args:
        log: To add to.
        station: The station that was simulated.
        raw: What it logged.
    """
    for name in _AS_LOGGED:
        if name in raw:
            log.add(name, raw[name])
    forces = [coordinate.force for coordinate in station.task.place.coordinates]
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
    """Add what an operator has made of the impedance, where it is not as the scenario says."""
    names = [coordinate.name for coordinate in station.task.place.coordinates]
    impedance = by_order(raw["impedance"], len(names))
    log.add("stiffness", impedance[:, STIFFNESS], labels=names)
    log.add("damping", impedance[:, DAMPING], labels=names)
    log.add("tank", raw["tank"])


def _joint_torques(station: Station, raw: Raw) -> np.ndarray:
    """Return what acts on tool and links means in the joints, shape (samples, N)."""
    q_J = raw["joint_state"][:, : station.robot.dimension]
    pushes = raw.get("push_torque", np.zeros_like(q_J))
    if len(q_J) == 0 or "wrench_ext" not in raw:
        return pushes
    function = joint_torque_function(station.robot).map(len(q_J))
    return np.array(function(q_J.T, raw["wrench_ext"].T)).T + pushes


def force_metrics(log: RunLog) -> Metrics:
    """Return the metrics of forces on the tool that a log has signals for.

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
    """Require that forces on a sensor that is not tared are below what is taken for a bias."""
    if not settings.compliance.needs_sensor:
        return {}
    spread = settings.sensor.taring_spread[:3].max()
    return {"max_unanswered_force": Target(f"<= {spread:g}", "sensor.taring_spread")}


def _sensor_warnings(log: RunLog) -> list[str]:
    """Return a warning if a force sensor was never of use."""
    if "tared" not in log or log["tared"].values.any() or not log.time.size:
        return []
    return [
        "the force/torque sensor was never tared: what should yield has rested, and no metric of "
        "compliance counts; its residual did not rest within sensor.taring_spread for "
        "sensor.taring_time, or its mean was above sensor.taring_bias"
    ]


def has_forces(log: RunLog) -> bool:
    """Whether the log has forces on the tool that are not all zero."""
    return any(style.largest(log[name].values) > 0.0 for name in _TITLES if name in log)


def draw_forces(log: RunLog) -> style.Drawing | None:
    """Forces along the path's coordinates, the wrench that acts and is measured.

    Moments have panels of their own, where they are more than noise. The times at which the
    force sensor is not tared yet, or faulty, are shaded.
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
            acting[0].set_label("acting")
        kind, unit = ("force", "N") if part.start == 0 else ("moment", "Nm")
        panel.set(ylabel=f"{kind} in {unit}", title=title)
    _shade_sensor(panels, log)
    for panel in panels:
        style.place_legend(panel)
    return style.Drawing("forces", "Forces on the tool", _caption(log), canvas)


def shade_pushes(panels: "list[Axes]", log: RunLog) -> None:
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
        peak = style.largest(force)
        if peak > 0.0:
            pushed = _bridged(force >= PUSHED * peak, round(PAUSE * len(force)))
            style.shade(panels, log.time, pushed, label, colour)


def _bridged(where: NDArray[np.bool_], gap: int) -> NDArray[np.bool_]:
    """Fills gaps of up to so many samples between true ones."""
    filled, true = where.copy(), np.flatnonzero(where)
    steps = np.diff(true)
    for k in np.flatnonzero((steps > 1) & (steps <= gap + 1)):
        filled[true[k] : true[k + 1]] = True
    return filled


def _has_moments(wrench: FloatArray) -> bool:
    """Whether the moments, after three forces, are more than noise."""
    return style.largest(wrench[:, 3:]) > LEVER * style.largest(wrench[:, :3])


def _shade_sensor(panels: "list[Axes]", log: RunLog) -> None:
    """Shades where the sensor is not tared, or faulty."""
    if "tared" in log:
        waiting = log["tared"].values[:, 0] == 0.0
        style.shade(panels, log.time, waiting, "sensor not tared", "#E5E7EB", "///")
    if "sensor_fault" in log:
        faulty = log["sensor_fault"].values[:, 0] != 0.0
        style.shade(panels, log.time, faulty, "sensor fault", "#FCA5A5")


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


def draw_damping(log: RunLog) -> style.Drawing | None:
    """Damping of the tangential coordinate over the arc length, wherever the tool was."""
    eta, damping = log["eta"].values[:, 0], log["damping"].values[:, 0]
    if np.ptp(damping) == 0.0:
        return None
    order = np.argsort(eta)
    canvas, (panel,) = style.make_panels(1, height=2.6, common_time=False)
    panel.plot(eta[order], 1e-3 * damping[order], color="C0")
    panel.set(xlabel=r"$\eta$ in m", ylabel="damping in kNs/m", ylim=(0.0, None))
    panel.set_title(r"Damping $d_\parallel$ over the arc length")
    caption = (
        f"Damping of the impedance along the path where the tool was, {damping.min():.3g} to "
        f"{damping.max():.4g} Ns/m."
    )
    return style.Drawing("damping", "Damping along the path", caption, canvas)


def draw_notch_position(log: RunLog) -> style.Drawing:
    """Way of the ball's centre in the notch, with the circle in which it touches nothing."""
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
    panel.set_title("Ball in the notch, seen along the path")
    panel.legend(loc="upper right")
    return style.Drawing(
        "notch",
        "Ball in the notch",
        "Centre of the ball in the cross-section of the notch; outside the dashed circle its soft "
        "shell is pressed.",
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
