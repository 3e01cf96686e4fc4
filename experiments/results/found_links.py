"""Where links were found without encoders on them, how sure that was, and how true."""

from collections.abc import Mapping

import numpy as np

from diagrams.station import Station
from experiments.results.run_log import FloatArray, RunLog, peak
from pfsc_drake.robot.robot_model import pose_function
from reporting.metrics import Metrics

_SIGMAS = 2.0
_OF_BLOCK = {
    "joint_torque": "tau_J_measured",
    "position_deviation": "q_J_deviation",
    "velocity_deviation": "v_J_deviation",
    "tool_deviation": "y_t_deviation",
}


def add_found_links(log: RunLog, station: Station, raw: Mapping[str, FloatArray]) -> None:
    """Add where links and tool were found, by what, and standard deviations, if they were.

    Args:
        log: To add to.
        station: The station that was simulated.
        raw: What it logged.
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
    """Return how sure and how true it was where links were found, if they were.

    Joints whose position is measured, as that of rigid ones is, do not count.

    Args:
        log: Log of the run.
    """
    metrics = Metrics()
    if "q_J_deviation" not in log:
        return metrics
    tool = np.linalg.norm(log["y_t_deviation"].values, axis=1)
    metrics.add("largest_tool_deviation", peak(tool))
    if "q_J_found" not in log:
        return metrics
    deviation = log["q_J_deviation"].values
    off = np.abs(log["q_J_found"].values - log["q_J"].values)
    found = deviation > 0.0
    share = float(np.mean(off[found] <= _SIGMAS * deviation[found])) if found.any() else np.nan
    metrics.add("links_within_two_sigma", share)
    return metrics
