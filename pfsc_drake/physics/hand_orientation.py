"""How a hand wants the tool to be turned over time."""

import numpy as np
from scipy.spatial.transform import Rotation

from pfsc_drake.geometry import zyx_to_matrix
from pfsc_drake.physics.force_profile import smooth_step, smooth_step_slope


def leg_at(times: np.ndarray, time: float) -> tuple[int, float, float]:
    """Return which leg of a way with rests a time is in, and how far along it, with minimum jerk.

    Args:
        times: At the ends of the legs, ascending, shape (k,) [s].
        time: [s].

    Returns:
        Index of the leg's begin, the share of the leg, 0 to 1, and its rate [1/s]; the last of the
        times and a share of zero once the way is over.
    """
    last = len(times) - 1
    i = min(max(int(np.searchsorted(times, time, side="right")) - 1, 0), last)
    if i == last:
        return last, 0.0, 0.0
    duration = float(times[i + 1] - times[i])
    x = (time - float(times[i])) / duration
    return i, smooth_step(x), smooth_step_slope(x) / duration


class OrientationTarget:
    """An orientation ``R_d`` that turns from one to the next about a fixed axis, the shorter way.

    It rests in each, as the target of the tool point does.

    Args:
        times: Of the orientations, ascending, shape (k,) [s].
        zyx_deg: Their ZYX angles (2.7), shape (k, 3) [deg].
    """

    def __init__(self, times: np.ndarray, zyx_deg: np.ndarray) -> None:
        self._times, self._R = times, zyx_to_matrix(np.deg2rad(zyx_deg))
        turns = self._R[1:] @ np.swapaxes(self._R[:-1], 1, 2)
        self._turns = np.vstack([rotation_vectors(turns), np.zeros(3)])

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Return ``R_d``, shape (3, 3), and its angular velocity, world axes, (3,) [rad/s].

        Args:
            time: [s].
        """
        i, share, rate = leg_at(self._times, time)
        turn = Rotation.from_rotvec(share * self._turns[i]).as_matrix()
        return turn @ self._R[i], rate * self._turns[i]


def rotation_vectors(R: np.ndarray) -> np.ndarray:
    """Return axis times angle, at most pi, of rotation matrices (k, 3, 3), shape (k, 3) [rad]."""
    if len(R) == 0:
        return np.zeros((0, 3))
    return np.asarray(Rotation.from_matrix(R).as_rotvec())
