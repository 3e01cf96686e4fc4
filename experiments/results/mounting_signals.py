"""Signals of plates that are mounted."""

import numpy as np

from diagrams.station import Station
from diagrams.surroundings.mounting import Mounting
from experiments.results.run_log import FloatArray, RunLog
from pfsc_drake.geometry import quaternion_to_matrix
from pfsc_drake.physics.mounting_hand import MountingPhase

PLATE_SIGNALS = {
    "plate_pose", "seat_gap", "seat_offset", "frame_force", "magazine_force", "held",
}  # fmt: skip
_WRENCH = ["f_x", "f_y", "f_z", "mu_x", "mu_y", "mu_z"]


def add_mounting_signals(log: RunLog, station: Station, raw: dict[str, np.ndarray]) -> None:
    """Add where plates are, what they touch, and what the operator does.

    Args:
        log: To add to.
        station: The station that was simulated.
        raw: What it logged.
    """
    if station.mounting is None:
        return
    poses = plate_poses(raw["plate_state"])
    names = [*"xyz", *(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))]
    labels = [f"plate_{k + 1}_{name}" for k in range(poses.shape[1] // 12) for name in names]
    log.add("plate_pose", poses, "m, 1", labels)
    gap, offset = seat_distances(station.mounting, poses[:, :12])
    log.add("seat_gap", gap, "m", [f"pin_{i + 1}" for i in range(gap.shape[1])])
    log.add("seat_offset", offset, "m")
    frame, magazine = np.hsplit(raw["plate_contact"], 2)
    log.add("frame_force", frame, "N", _WRENCH[:3])
    log.add("magazine_force", magazine, "N", _WRENCH[:3])
    log.add("held", raw["held"], "1")
    log.add("gripper_wrench", raw["gripper_wrench"], "N, Nm", _WRENCH)
    if "hand_wrench" in raw:
        log.add("hand_wrench", raw["hand_wrench"], "N, Nm", _WRENCH)
        phases = [phase.name.lower() for phase in MountingPhase]
        log.add("phase", raw["phase"].astype(int), "1", phases)


def plate_poses(state: FloatArray) -> FloatArray:
    """Return ``[p, R by rows]`` of K plates, world axes, shape (samples, 12 K).

    Args:
        state: Of their plant, see :func:`~pfsc_drake.physics.suction.cups_function`, shape
            (samples, 13 K).
    """
    samples, count = len(state), state.shape[1] // 13
    q = state[:, : 7 * count].reshape(samples, count, 7)
    R = quaternion_to_matrix(q[..., :4]).reshape(samples, count, 9)
    return np.concatenate([q[..., 4:], R], axis=2).reshape(samples, 12 * count)


def seat_distances(mounting: Mounting, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far a plate is from its seat.

    Args:
        mounting: Where the seat is.
        pose: ``[p, R by rows]`` of the plate, shape (samples, 12).

    Returns:
        The gap between underside and frame at each pin, negative for what is below its surface,
        shape (samples, pins), and the distance beside the seat, shape (samples, 1) [m].
    """
    pins, seat = np.array(mounting.parameters.pins.positions), mounting.X_WF
    roots = np.column_stack([pins, np.zeros(len(pins))])
    R = pose[:, 3:].reshape(-1, 3, 3)
    points = pose[:, np.newaxis, :3] + np.einsum("tij,nj->tni", R, roots)
    # the face that is gripped is as far from its seat as the underside
    in_frame = (points - seat.translation()) @ seat.rotation().matrix()
    beside = np.linalg.norm(in_frame[:, :, :2] - pins, axis=2).max(axis=1, keepdims=True)
    return -in_frame[:, :, 2], beside
