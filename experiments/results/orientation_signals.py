"""The orientation of a tool and of its reference in the log of a run."""

import numpy as np
from scipy.spatial.transform import Rotation

from diagrams.station import Station
from experiments.results.run_log import RunLog
from pfsc_drake.control.manifolds.manifold import PlaceManifold
from pfsc_drake.geometry import angle_between, matrix_to_zyx, matrix_to_zyz, turn_about


def add_orientation(
    log: RunLog, station: Station, followed: np.ndarray, place: np.ndarray, pose: np.ndarray
) -> None:
    """Add the ZYX angles of the tool and of the reference that the law compares it with.

    They are ZYZ angles where those are coordinates. And how far that reference is away from the
    orientation that belongs to the tool's place. Where only an axis of the tool matters, its
    directions take the place of the angles; where only its turn about an axis in space does, the
    turn since the reference that the run begins with.

    Args:
        log: To add to; nothing without an orientation to follow.
        station: The station that was simulated.
        followed: Points of the manifold that the law acted on, shape (samples, size).
        place: Points of the manifold next to the tool, shape (samples, size).
        pose: ``[y_t, R_e by rows]`` of the tool, shape (samples, 12).
    """
    linearization = station.law.linearization
    if not station.task.place.is_oriented:
        return
    point = followed if linearization.manifold.follows_time else place
    R_e, R_d = _rotations(station.task.place, pose, point)
    _, R_place = _rotations(station.task.place, pose, place)
    unknown = ~(np.isfinite(point).all(axis=1) & np.isfinite(pose).all(axis=1))
    tool = station.task.place.tool
    axis, yaw_axis = tool.tool_axis, tool.yaw_axis
    begin = R_d[int(np.argmin(unknown))] if len(R_d) else np.eye(3)
    for name, R in {"e": R_e, "d": R_d}.items():
        if yaw_axis is not None:
            turn = np.unwrap(turn_about(yaw_axis, R, begin))
            log.add(f"angles_{name}", np.where(unknown, np.nan, turn), labels=["the yaw axis"])
        elif axis is None:
            of_zyz = tool.euler == "zyz"
            angles = np.unwrap(matrix_to_zyz(R) if of_zyz else matrix_to_zyx(R), axis=0)
            angles[unknown] = np.nan
            log.add(f"angles_{name}", angles, labels=["z", "y", "z2" if of_zyz else "x"])
        else:
            directions = np.where(unknown[:, None], np.nan, R @ axis)
            log.add(f"axis_{name}", directions)
    lead = np.full(len(place), np.nan)
    if yaw_axis is not None:
        lead[~unknown] = np.abs(turn_about(yaw_axis, R_d, R_place))[~unknown]
    elif axis is not None:
        lead[~unknown] = angle_between(R_place @ axis, R_d @ axis)[~unknown]
    elif not unknown.all():
        between = np.swapaxes(R_place, 1, 2) @ R_d
        lead[~unknown] = Rotation.from_matrix(between[~unknown]).magnitude()
    log.add("orientation_lead", lead)


def _rotations(
    manifold: PlaceManifold, pose: np.ndarray, point: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the tool's and the place's orientation, each (samples, 3, 3); I where not finite."""
    finite = np.isfinite(point).all(axis=1) & np.isfinite(pose).all(axis=1)
    R_e = np.where(finite[:, None], pose[:, 3:], np.eye(3).ravel()).reshape(-1, 3, 3)
    R_d = np.tile(np.eye(3), (len(point), 1, 1))
    if finite.any():
        R_d[finite] = manifold.orientation(point[finite])
    return R_e, R_d
