"""Law and drives: virtual input, faults, torques and saturation.

Signals used, as in the log: ``tau_d`` [samples, axes] with attribute ``limits``,
``saturated_drives`` and ``fault`` [samples, 1].
"""

import math
from typing import TYPE_CHECKING

import numpy as np

from diagrams.scenario import Scenario, Target
from diagrams.station import Station
from experiments.results.feature import Feature, Raw
from experiments.results.forces_feature import shade_pushes
from experiments.results.joints_feature import axis_labels, draw_limit, nears_limit
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.supervision import DRIVE_MEMORY
from pfsc_drake.robot.coordinate_text import eta_text
from reporting import style
from reporting.metrics import Metrics

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SATURATION_MARGIN = 1e-9  # relative; a saturated command equals the limit up to rounding
PEAK_RATIO = 4.0  # first peak to the rest of the run, above which the rest is drawn enlarged
EFFORTS = {"Nm": "torque", "N": "force"}
_EFFORT_TITLES = {"Nm": "torques", "N": "forces"}
_TITLES = {"eta": "Tangential", "xi": "Transversal", "phi": "Rotational"}
_SYMBOLS = {"eta": r"\eta", "xi": r"\xi", "phi": r"\phi"}
_DWARFED = 4.0  # ratio of the initial peak to the rest, above which the peak is cut off


def add_drives(log: RunLog, station: Station, raw: Raw) -> None:
    """Add commands and status of the law, and torques of drives and transmissions.

    Args:
        log: Log of the run, which is extended.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    law, layout, degree = raw["law"], station.law.layout, station.law.linearization.relative_degree
    faults = [fault.name.lower() for fault in Fault]
    names = [f"v_{coordinate.name}" for coordinate in station.task.projected_manifold.coordinates]
    log.add("virtual_input", law[:, layout.virtual_input], f"SI/s^{degree}", names)
    fault, rcond, saturated = law[:, layout.status].T[:3]
    log.add("fault", fault.astype(int), labels=faults)
    log.add("rcond", rcond)
    log.add("saturated_drives", saturated.astype(int))
    requested = raw["stop_category"]
    if "servo_stop_category" in raw:
        requested = np.hstack([requested, raw["servo_stop_category"]])
    # the lowest category is the most urgent; negative for none
    urgent = np.where(requested < 0.0, np.inf, requested).min(axis=1)
    log.add("stop_category", np.where(np.isfinite(urgent), urgent, -1.0).astype(int))
    if degree > 1:
        log.add("tau_d", law[:, layout.drive], limits=station.law.limits)
    if station.servo is not None:
        if not station.robot.is_massless:
            log.add("tau_d", raw["drive_torque"], limits=station.servo.limits)
        log.add("servo_fault", raw["servo_fault"].astype(int), labels=faults)
    elastic = station.robot.elastic_joints
    if elastic.any():
        q_J, v_J, q_M, v_M = np.hsplit(raw["joint_state"], 4)
        K_s, K_d = station.robot.K_s[elastic], station.robot.K_d[elastic]
        tau_J = K_s * (q_M - q_J)[:, elastic] + K_d * (v_M - v_J)[:, elastic]
        log.add("tau_J", tau_J, labels=[f"tau_J_{i + 1}" for i in np.flatnonzero(elastic)])


def drive_metrics(log: RunLog) -> Metrics:
    """Return peak torques and saturation of the drives, if they are logged.

    Args:
        log: Log of a run.
    """
    metrics = Metrics()
    if "tau_d" not in log:
        return metrics
    for axis, torque in enumerate(peak_torque(log), start=1):
        metrics.add(f"peak_torque_{axis}", float(torque), log["tau_d"].unit)
    saturated = saturation_count(log)
    metrics.add("saturated_samples", saturated)
    metrics.add("saturated_share", saturated / max(log.time.size, 1))
    if log["tau_d"].limits is not None and "fault" in log:
        metrics.add("limit_reversals", limit_reversals(log))
    return metrics


def _requirements(settings: Scenario) -> dict[str, Target]:
    """Require fewer reversals than the supervision's threshold for chatter."""
    turns = settings.faults.chatter_turns
    return (
        {"limit_reversals": Target(f"< {turns:g}", "faults.chatter_turns")} if turns > 0.0 else {}
    )


def peak_torque(log: RunLog) -> FloatArray:
    """Return the largest drive torque of each axis.

    Args:
        log: With ``tau_d``.

    Returns:
        [axes] in the unit of ``tau_d``.
    """
    values = np.abs(log["tau_d"].values)
    return np.asarray(np.max(values, axis=0) if len(values) else np.full(values.shape[1], math.nan))


def saturation_count(log: RunLog) -> int:
    """Return the number of samples with saturation, see :func:`is_saturated`.

    Args:
        log: Log of the run.

    Returns:
        Between 0 and the number of samples.
    """
    return int(np.count_nonzero(is_saturated(log)))


def saturation_warnings(log: RunLog) -> list[str]:
    """Return warnings about saturated drives, one sentence each.

    Args:
        log: As for :func:`is_saturated`.
    """
    saturated = is_saturated(log)
    count = int(np.count_nonzero(saturated))
    if not count:
        return []
    first = float(log.time[int(saturated.argmax())])
    where = ""
    if "eta" in log:
        eta = log["eta"].values[int(saturated.argmax())]
        where = f", {eta_text(eta, digits=3)}"
    return [
        f"drives were saturated in {count} samples, {100.0 * count / saturated.size:.2g} % of "
        f"the run, first at {first:.3f} s{where}: meanwhile the properties of the control law do "
        "not hold"
    ]


def limit_reversals(log: RunLog) -> float:
    """Return the largest number of reversals of a drive's torque between its limits, without fault.

    The count follows :class:`~pfsc_drake.control.law.supervision.DriveWatch` with the same decay,
    applied to the torques of the drives, also of velocity servos, instead of commands.

    Args:
        log: With ``tau_d``, its limits, and ``fault``.
    """
    signal = log["tau_d"]
    assert signal.limits is not None  # of drives
    followed = log["fault"].values[:, 0] == Fault.NONE
    at_limit = np.abs(signal.values) >= signal.limits * (1.0 - SATURATION_MARGIN)
    most = 0.0
    for torque, counted in zip(signal.values.T, (at_limit & followed[:, None]).T, strict=True):
        time, side = log.time[counted], np.sign(torque[counted])
        turns, last = 0.0, -np.inf
        for turned in time[1:][side[1:] != side[:-1]]:
            turns = turns * np.exp((last - turned) / DRIVE_MEMORY) + 1.0
            most, last = max(most, turns), turned
    return most


def is_saturated(log: RunLog) -> np.ndarray:
    """Return the samples at which the law or a drive is saturated, shape (samples,).

    Either the law requests, without a fault, more than the limit of a drive: torque, or speed of
    velocity servos (``saturated_drives``); or the torque of a drive is at its limit, commanded by
    the law, a servo or the safe state after a fault.

    Args:
        log: With ``tau_d`` and its ``limits``, or ``saturated_drives`` with ``fault``, or both.
    """
    saturated = np.zeros(log.time.size, dtype=bool)
    if "tau_d" in log and (signal := log["tau_d"]).limits is not None:
        at_limit = np.abs(signal.values) >= signal.limits * (1.0 - SATURATION_MARGIN)
        saturated |= np.any(at_limit, axis=1)
    if "saturated_drives" in log:
        requested = log["saturated_drives"].values[:, 0] > 0
        # after a fault the drives do not follow the law
        saturated |= requested & (log["fault"].values[:, 0] == Fault.NONE)
    return saturated


def draw_efforts(log: RunLog) -> style.Drawing:
    """Draw drive torques or forces, three axes per panel, with nearby limits (dashed).

    If a short peak dominates, a second panel shows the rest enlarged.
    """
    signal = log["tau_d"]
    title = f"Drive {_EFFORT_TITLES.get(signal.unit, 'torques and forces')}"
    groups = [range(i, min(i + 3, signal.dim)) for i in range(0, signal.dim, 3)]
    dwarfed = [style.is_dwarfed(log.time, signal.values[:, group], PEAK_RATIO) for group in groups]
    canvas, panels = style.make_panels(len(groups) + sum(dwarfed), height=2.6)
    labels = axis_labels(signal.dim)
    free = iter(panels)
    for group, enlarge in zip(groups, dwarfed, strict=True):
        panel = next(free)
        _draw_group(panel, log, group, labels)
        axes = f"axes {group[0] + 1} to {group[-1] + 1}" if len(group) > 1 else labels[group[0]]
        panel.set(ylabel=effort_label(signal.unit), title=f"{title}, {axes}")
        style.add_legend(panel)
        if enlarge:
            panel = next(free)
            values = signal.values[:, group]
            for axis in group:
                panel.plot(log.time, signal.values[:, axis], color=f"C{axis}")
            style.scale_to_late(panel, log.time, values)
            enlarged = "Scaled to the last three quarters"
            panel.set(ylabel=effort_label(signal.unit), title=enlarged)
    caption = f"{title.removeprefix('Drive ').capitalize()} of the drives"
    limited = any(nears_limit(signal, axis) for axis in range(signal.dim))
    caption += "; dashed: limits within reach." if limited else "."
    name = title.lower().replace(" ", "_")
    return style.Drawing(name, title, caption, canvas)


def effort_label(unit: str) -> str:
    """Return the label of an axis, in two lines for drives of both kinds."""
    return f"{EFFORTS[unit]} in {unit}" if unit in EFFORTS else f"torque or force\nin {unit}"


def _draw_group(panel: "Axes", log: RunLog, group: range, labels: list[str]) -> None:
    """Draw the torques or forces of some axes with their limits."""
    signal = log["tau_d"]
    for axis in group:
        colour = f"C{axis}"
        panel.plot(log.time, signal.values[:, axis], color=colour, label=labels[axis])
        draw_limit(panel, signal, axis)


def draw_virtual_input(log: RunLog) -> style.Drawing | None:
    """Draw virtual input v of the law (Fig. 3.6 c, 4.4 c), a panel for each kind of coordinates.

    Args:
        log: With ``virtual_input``, labelled by ``v_`` and the coordinate.
    """
    signal = log["virtual_input"]
    kinds = [name for name in _TITLES if name in log]
    if not kinds:
        return None
    canvas, panels = style.make_panels(len(kinds), height=2.1)
    for kind, panel in zip(kinds, panels, strict=True):
        columns = [signal.labels.index(f"v_{label}") for label in log[kind].labels]
        values = signal.values[:, columns]
        labels = [_symbol(kind, label) for label in log[kind].labels]
        panel.axhline(0.0, color=style.REFERENCE, linewidth=0.8)
        style.draw_components(panel, log.time, values, labels)
        title = _TITLES[kind]
        if style.is_dwarfed(log.time, values, _DWARFED):
            style.scale_to_late(panel, log.time, values)
            title += ", scaled to the last three quarters"
        unit = _written(signal.unit, log[kind].unit)
        panel.set(ylabel=f"$v$ in {unit}", title=title)
    shade_pushes(panels, log)
    for panel in panels:
        style.add_legend(panel)
    order = signal.unit.rpartition("^")[2]
    word = {"1": "first", "2": "second", "3": "third", "4": "fourth"}[order]
    caption = (
        f"Desired {word} time derivatives of the coordinates: derivatives of the reference minus"
        " feedback of errors and their integrals."
    )
    return style.Drawing("virtual_input", "Virtual input of the law", caption, canvas)


def _symbol(kind: str, label: str) -> str:
    """Return the symbol of a component for a coordinate such as ``xi_1``."""
    return f"$v_{{{_SYMBOLS[kind]}{label.removeprefix(kind)}}}$"


def _written(unit: str, coordinate: str) -> str:
    """Return the unit of a derivative, ``SI/s^2``, with the unit of its coordinate."""
    base, _, order = unit.replace("SI", coordinate).partition("^")
    return base if order == "1" else f"{base}$^{order}$"


FEATURE = Feature(
    signals=add_drives,
    metrics=lambda log, station, settings: drive_metrics(log),
    requirements=_requirements,
    warnings=lambda log, station, settings: saturation_warnings(log),
    figures={"virtual_input": draw_virtual_input, "drive_torques": draw_efforts},
)
