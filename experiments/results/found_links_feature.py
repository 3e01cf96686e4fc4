"""Estimated positions of links without encoders: estimate, standard deviation, error."""

import numpy as np

from diagrams.station import Station
from experiments.results.feature import Feature, Raw
from experiments.results.run_log import RunLog, peak
from pfsc_drake.robot.robot_model import pose_function
from reporting import style
from reporting.metrics import Metrics

_SIGMAS = 2.0
_OF_BLOCK = {
    "joint_torque": "tau_J_measured",
    "position_deviation": "q_J_deviation",
    "velocity_deviation": "v_J_deviation",
    "tool_deviation": "y_t_deviation",
}
_MILLI = 1e3
_UNITS = {"rad": "mrad", "m": "mm"}


def add_found_links(log: RunLog, station: Station, raw: Raw) -> None:
    """Add estimated positions of links and tool, their inputs and standard deviations, if any.

    Args:
        log: Log of the run, which is extended.
        station: The station that was simulated.
        raw: Its logged signals.
    """
    for port, name in _OF_BLOCK.items():
        if port in raw:
            log.add(name, raw[port])
    if "found_joint_state" not in raw:
        return
    q_J = raw["found_joint_state"][:, : station.robot.dimension]
    log.add("q_J_found", q_J)
    pose = np.zeros((0, 3))
    if len(q_J):
        pose = np.array(pose_function(station.robot).map(len(q_J))(q_J.T)).T[:, :3]
    log.add("y_t_found", pose)


def found_links_metrics(log: RunLog) -> Metrics:
    """Return standard deviation and consistency of estimated link positions, if any.

    Joints with measured position, such as rigid ones, do not count.

    Args:
        log: Log of the run.
    """
    metrics = Metrics()
    if "q_J_deviation" not in log:
        return metrics
    tool = log.norm("y_t_deviation")
    metrics.add("largest_tool_deviation", peak(tool))
    if "q_J_found" not in log:
        return metrics
    deviation = log["q_J_deviation"].values
    off = np.abs(log["q_J_found"].values - log["q_J"].values)
    found = deviation > 0.0
    share = float(np.mean(off[found] <= _SIGMAS * deviation[found])) if found.any() else np.nan
    metrics.add("links_within_two_sigma", share)
    return metrics


def draw_found_links(log: RunLog) -> style.Drawing:
    """Draw errors of the links' positions and of the tool point, beside two standard deviations.

    Args:
        log: With ``q_J``, ``q_J_found``, ``q_J_deviation``, and likewise ``y_t``.
    """
    signal = log["q_J"]
    canvas, panels = style.make_panels(signal.dim + 1, height=1.15)
    off = _MILLI * (log["q_J_found"].values - signal.values)
    deviation = _SIGMAS * _MILLI * log["q_J_deviation"].values
    for axis, panel in enumerate(panels[:-1]):
        band = deviation[:, axis]
        panel.fill_between(log.time, -band, band, color=style.REFERENCE, alpha=0.2, linewidth=0.0)
        panel.plot(log.time, off[:, axis], color=f"C{axis}", label="error")
        panel.set(ylabel=_UNITS.get(signal.unit, "mrad or mm"))
        panel.set_title(f"axis {axis + 1}", fontsize=10)
    tool = _MILLI * np.linalg.norm(log["y_t_found"].values - log["y_t"].values, axis=1)
    band = _SIGMAS * _MILLI * log.norm("y_t_deviation")
    panels[-1].fill_between(log.time, 0.0, band, color=style.REFERENCE, alpha=0.2, linewidth=0.0)
    panels[-1].plot(log.time, tool, color="C0")
    panels[-1].set(ylabel="mm")
    panels[-1].set_title("tool point", fontsize=10)
    style.add_legend(panels[0])
    caption = (
        "Errors of link positions estimated from motors and torques, and resulting error of the "
        "tool"
        " point; grey: two standard deviations."
    )
    return style.Drawing("found_links", "Estimated link positions", caption, canvas)


FEATURE = Feature(
    signals=add_found_links,
    metrics=lambda log, station, settings: found_links_metrics(log),
    figures={"found_links": draw_found_links},
)
