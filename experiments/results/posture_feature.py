"""Posture of redundant arms, and conditioning of the decoupling matrix.

Signals used, as in the log: ``q_J``, ``v_J`` [samples, N] rad and rad/s, ``q_posture``
[samples, N] rad, ``eta``, ``eta_dot`` [samples, 1] m and m/s, ``rcond`` [samples, 1].
"""

import math

import casadi as ca
import numpy as np

from diagrams.scenario import Scenario
from diagrams.station import Station
from experiments.results.feature import Feature, Raw
from experiments.results.forces_feature import shade_pushes
from experiments.results.joints_feature import axis_labels, has_spare_joints, position_unit
from experiments.results.pushes_feature import finite_peak, is_redundant
from experiments.results.run_log import RunLog
from pfsc_drake import jets
from reporting import style
from reporting.metrics import Metrics

REST = 0.1  # s, end of a run over which the joints' speeds are evaluated
AT_REST = 1e-3  # m/s, below which the tool rests
AWAY = 1e-2  # m, distance from the start of a departed tool
_WORTH_A_LOOK = 10.0  # multiple of the threshold below which conditioning is drawn for any arm


def add_posture(log: RunLog, station: Station, raw: Raw) -> None:
    """Log the posture reference, the controlled posture coordinate, and the damping residual.

    Args:
        log: Log of the run.
        station: The station.
        raw: Its logged signals, each (samples, size).
    """
    law, n = station.law, station.robot.dimension
    residual = raw["law"][:, law.layout.residual]
    if residual.shape[1]:
        labels = [coordinate.name for coordinate in law.linearization.manifold.coordinates]
        degree = law.linearization.relative_degree
        log.add("decoupling_residual", residual, f"SI/s^{degree}", labels)
    if "posture_reference" not in raw:
        return
    reference = raw["posture_reference"][:, :n]
    log.add("q_posture", reference)
    assert law.posture is not None
    if law.posture.coordinate is None:
        return
    swivel = np.zeros((2, len(reference)))
    if len(reference):
        q = ca.SX.sym("q", n)
        angle = law.posture.coordinate([jets.constant(q[i], 1) for i in range(n)]).coefficients[0]
        evaluate = ca.Function("coordinate", [q], [angle]).map(len(reference))
        both = (raw["joint_state"][:, :n], reference)
        swivel = np.array([np.unwrap(np.array(evaluate(x.T)).ravel()) for x in both])
    log.add("swivel", swivel.T, labels=["swivel", "swivel_p"])


def posture_metrics(log: RunLog, revolution: float | None) -> Metrics:
    """Return the posture metrics whose signals a run has.

    Args:
        log: Log of a run.
        revolution: Length of its closed path [m], or None.
    """
    metrics, angle = Metrics(), log["q_J"].unit
    if "q_posture" in log:
        metrics.add("max_posture_error", max_posture_error(log), angle)
    if has_spare_joints(log):
        if revolution is not None:
            metrics.add("posture_return", posture_return(log, revolution), angle)
        metrics.add("final_joint_speed", final_joint_speed(log), log["v_J"].unit)
    return metrics


def max_posture_error(log: RunLog) -> float:
    """Return the largest distance of a joint from the reference posture [rad]."""
    return finite_peak(log["q_J"].values - log["q_posture"].values)


def final_joint_speed(log: RunLog) -> float:
    """Return the largest speed of a joint over the end of a run [rad/s, of slides m/s].

    NaN if the tool does not rest there.
    """
    late = log.time >= log.time[-1] - REST
    rests = finite_peak(_progress_rate(log)[late]) < AT_REST
    return finite_peak(log["v_J"].values[late]) if rests else math.nan


def _progress_rate(log: RunLog) -> np.ndarray:
    """Return the rate of progress [m/s]; with velocity servos by differentiation."""
    if "eta_dot" in log:
        return log["eta_dot"].values
    eta = log["eta"].values
    return np.gradient(eta, log.time, axis=0) if len(eta) > 1 else np.zeros_like(eta)


def posture_return(log: RunLog, revolution: float) -> float:
    """Return the largest difference of a joint from the first revolution at the same path position.

    The first revolution begins at the tool's departure; the approach to the path does not count.

    Args:
        log: With ``q_J``, ``eta`` and ``eta_dot`` of a closed path.
        revolution: Length of the path [m].

    Returns:
        rad (m for slides); NaN without a second revolution.
    """
    begin = _setting_off(log)
    eta, q = log["eta"].values[begin:, 0], log["q_J"].values[begin:]
    along = np.maximum.accumulate(eta)
    first = along <= eta[0] + revolution
    later = eta > eta[0] + revolution
    if not later.any():
        return math.nan
    position = eta[0] + np.mod(eta[later] - eta[0], revolution)
    expected = [np.interp(position, along[first], column[first]) for column in q.T]
    return finite_peak(q[later] - np.stack(expected, axis=1))


def _setting_off(log: RunLog) -> int:
    """Return the last sample at rest before the tool's departure."""
    eta, speed = log["eta"].values[:, 0], _progress_rate(log)[:, 0]
    away = eta - eta[0] > AWAY
    gone = int(np.argmax(away)) if away.any() else len(eta)
    resting = np.flatnonzero(np.abs(speed[:gone]) < AT_REST)
    return int(resting[-1]) if resting.size else 0


def draw_conditioning(log: RunLog) -> style.Drawing | None:
    """Draw reciprocal condition number of the decoupling matrix over time and along the path.

    It is drawn for redundant arms, and near its threshold.

    Args:
        log: With ``rcond``, perhaps with ``eta``.
    """
    signal = log["rcond"]
    known = signal.values[np.isfinite(signal.values)]
    near = signal.limits is not None and np.any(known < _WORTH_A_LOOK * signal.limits[0, 0])
    if not known.size or not (near or has_spare_joints(log)):
        return None
    along = "eta" in log
    canvas, panels = style.make_panels(1 + along, height=2.6, common_time=False)
    values = np.where(signal.values[:, 0] > 0.0, signal.values[:, 0], np.nan)
    over = [("over time", "time in s", log.time)]
    over += [("along the path", r"$\eta$ in m", log["eta"].values[:, 0])] if along else []
    for panel, (title, label, horizontal) in zip(panels, over, strict=True):
        panel.semilogy(horizontal, values, color="C0", label="conditioning")
        if signal.limits is not None:
            least = float(signal.limits[0, 0])
            panel.axhline(
                least, linestyle="--", color=style.ALERT, linewidth=1.2, label="threshold"
            )
        panel.set(xlabel=label, ylabel="1 / condition", title=f"Conditioning {title}")
    style.add_legend(panels[0])
    caption = "Reciprocal condition number of the decoupling matrix; 0 at a singular posture"
    caption += ", dashed: the law's threshold" if signal.limits is not None else ""
    return style.Drawing("conditioning", "Conditioning along the path", f"{caption}.", canvas)


def draw_posture(log: RunLog) -> style.Drawing:
    """Draw the joints' distance from the reference posture, and the swivel angle if logged.

    Args:
        log: With ``q_J`` and ``q_posture``, perhaps with ``swivel`` and its reference.
    """
    signal = log["q_J"]
    factor, unit = position_unit(signal)
    swivel = "swivel" in log
    canvas, panels = style.make_panels(1 + swivel, height=2.8)
    error = factor * (signal.values - log["q_posture"].values)
    panels[0].axhline(0.0, color=style.REFERENCE, linewidth=0.8)
    style.draw_components(panels[0], log.time, error, axis_labels(signal.dim))
    panels[0].set(ylabel=f"error in {unit}", title="Distance from the reference posture")
    if swivel:
        angle = np.rad2deg(log["swivel"].values)
        panels[1].plot(log.time, angle[:, 0], color="C0", label="swivel angle")
        if angle.shape[1] == 2:
            panels[1].plot(
                log.time, angle[:, 1], "--", color=style.INK, linewidth=1.1, label="reference"
            )
        panels[1].set(ylabel="angle in deg", title="Swivel angle of the elbow")
    shade_pushes(panels, log)
    for panel in panels:
        style.add_legend(panel)
    caption = (
        "Joint coordinates minus reference posture; the difference is due to the tool's motion"
    )
    return style.Drawing("posture", "Posture", f"{caption}.", canvas)


def _known(station: Station, _settings: Scenario) -> list[str]:
    """Return properties of robot and path required by posture metrics."""
    properties = {"redundant": is_redundant(station), "closed": station.task.revolution is not None}
    return [name for name, is_so in properties.items() if is_so]


FEATURE = Feature(
    signals=add_posture,
    metrics=lambda log, station, settings: posture_metrics(log, station.task.revolution),
    known=_known,
    figures={"posture": draw_posture, "conditioning": draw_conditioning},
)
