"""Signals of a run, from the signals logged by its station."""

import numpy as np
from pydrake.systems.framework import Context

from diagrams.station import Station
from experiments.results.coordinates_feature import acts_on_truth
from experiments.results.feature import Raw
from experiments.results.features import FEATURES
from experiments.results.holder_feature import relative_poses, workpiece_motion
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.robot.robot_model import pose_function


def collect_log(station: Station, root: Context) -> RunLog:
    """Return the signals of a run, named and with units as scripts expect them.

    Joint state, tool pose and path coordinates are the actual ones of the links, also if the law
    acts on motor coordinates, on errors from a moving reference point, or on imperfect
    measurements. The law's own signals are logged beside them: ``xi_M``, ``tracking_error``,
    ``q_J_measured``, ``y_t_measured``, ``xi_measured`` and so on.

    Args:
        station: The station that was simulated.
        root: Its context at the end.
    """
    return _named(station, *station.log.read(root))


def expected_signals(station: Station) -> set[str]:
    """Return the names of the signals of a station's run.

    Signals that need a full revolution, or another event, may be added.

    Args:
        station: The station, simulated or not.
    """
    empty = {name: np.zeros((0, row.stop - row.start)) for name, row in station.log.rows.items()}
    return set(_named(station, np.zeros(0), empty).signals)


def _named(station: Station, times: FloatArray, raw: Raw) -> RunLog:
    """Return the log of a run from logged signals of a station."""
    log = RunLog(times, turning=station.robot.gather("is_revolute").tolist())
    raw = _with_truth(station, raw)
    for feature in FEATURES:
        feature.signals(log, station, raw)
    return log


def _with_truth(station: Station, raw: Raw) -> Raw:
    """Return logged signals with the ground truth of the tool's pose.

    ``true_pose`` is ``[y_t, R_e by rows]`` of the links, shape (samples, 12); ``true_points`` are
    its projections on the manifold; ``workpiece_motion`` is the motion of a moving workpiece, whose
    frame then is the frame of the other two.
    """
    raw = dict(raw)
    q_J = raw["joint_state"][:, : station.robot.dimension]
    pose = np.zeros((0, 12))
    if len(q_J):
        pose = np.array(pose_function(station.robot).map(len(q_J))(q_J.T)).T
    frames = workpiece_motion(station, raw)
    if frames is not None:
        raw["workpiece_motion"], pose = frames, relative_poses(pose, frames)
    raw["true_pose"], raw["true_points"] = pose, raw["manifold_point"]
    if not acts_on_truth(station, raw):
        raw["true_points"] = (
            raw["actual_projection"] if "actual_projection" in raw else _project(station, pose)
        )
    return raw


def _project(station: Station, pose: FloatArray) -> FloatArray:
    """Project a motion of the tool on the manifold, sample by sample; shape (samples, size)."""
    task, memory = station.task, station.initial_projection
    points = np.full((len(pose), task.projected_manifold.layout.size), np.nan)
    for k, y_t in enumerate(pose[:, :3]):
        if np.isfinite(y_t).all():
            points[k] = task.evaluate(y_t, memory)
            memory = points[k, task.projected_manifold.layout.memory]
    return points
