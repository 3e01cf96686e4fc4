"""Direct kinematics of serial robots with revolute joints in Denavit-Hartenberg convention."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pfsc_drake.errors import InputError


def dh_transform(theta: float, d: float, a: float, alpha: float) -> np.ndarray:
    """Return the homogeneous transformation from DH frame i to DH frame i - 1, eq. (2.4).

    ``H_{i-1}^i = H_{Rz,theta} H_{Tz,d} H_{Tx,a} H_{Rx,alpha}`` with the block form (2.2).

    Args:
        theta: joint angle about z_{i-1} [rad].
        d: offset along z_{i-1} [m].
        a: length along x_i [m].
        alpha: twist about x_i [rad].

    Returns:
        ``[4, 4]``, maps coordinates in frame i to coordinates in frame i - 1.
    """
    c_t, s_t = np.cos(theta), np.sin(theta)
    c_a, s_a = np.cos(alpha), np.sin(alpha)
    return np.array(
        [
            [c_t, -s_t * c_a, s_t * s_a, a * c_t],
            [s_t, c_t * c_a, -c_t * s_a, a * s_t],
            [0.0, s_a, c_a, d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


@dataclass(frozen=True, eq=False)
class DenavitHartenberg:
    """The DH table of a serial robot with N revolute joints, such as Tab. 2.1.

    Frame 0 is the inertial frame (base), frame i is fixed to link i, and z_i is the axis of joint
    i + 1. The joint coordinates are the DH angles ``q_J = [theta_1, ..., theta_N]``.

    Attributes:
        d: ``[N]`` offsets along z_{i-1} [m].
        a: ``[N]`` lengths along x_i [m].
        alpha: ``[N]`` twists about x_i [rad].
    """

    d: np.ndarray
    a: np.ndarray
    alpha: np.ndarray

    def __post_init__(self) -> None:
        for name in ("d", "a", "alpha"):
            column = np.array(getattr(self, name), dtype=float)
            if column.ndim != 1 or column.size == 0 or not np.all(np.isfinite(column)):
                raise InputError(f"DH column {name} = {column}: must be a row of finite numbers")
            column.flags.writeable = False
            object.__setattr__(self, name, column)
        sizes = {"d": self.d.size, "a": self.a.size, "alpha": self.alpha.size}
        if len(set(sizes.values())) > 1:
            raise InputError(f"DH columns have sizes {sizes}: all must be equal")

    @property
    def axes(self) -> int:
        """The number of joints N."""
        return self.d.size

    def link_poses(self, q: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return the poses of all DH frames in the base, ``H_0^i`` of (2.3) for i = 0..N.

        Args:
            q: ``[N]`` DH angles [rad].

        Returns:
            ``[N + 1, 4, 4]``; entry i maps coordinates in frame i to coordinates in frame 0.

        Raises:
            InputError: if ``q`` does not hold N finite angles.
        """
        q = np.asarray(q, dtype=float)
        if q.shape != (self.axes,) or not np.all(np.isfinite(q)):
            raise InputError(f"joint angles {q}: must be {self.axes} finite numbers")
        poses = np.empty((self.axes + 1, 4, 4))
        poses[0] = np.eye(4)
        for i in range(self.axes):
            poses[i + 1] = poses[i] @ dh_transform(q[i], self.d[i], self.a[i], self.alpha[i])
        return poses

    def pose(
        self, q: Sequence[float] | np.ndarray, tool_offset: Sequence[float] | np.ndarray = (0, 0, 0)
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return position and orientation of the end-effector, eq. (2.5).

        Args:
            q: ``[N]`` DH angles [rad].
            tool_offset: ``[3]`` tool point ``[x_NT, y_NT, z_NT]`` in DH frame N [m].

        Returns:
            ``y_t`` ``[3]``, the tool point in frame 0 [m], and ``R_e`` ``[3, 3]``, which maps
            coordinates in frame N to coordinates in frame 0.

        Raises:
            InputError: if ``q`` does not hold N finite angles.
        """
        flange = self.link_poses(q)[-1]
        R_e = flange[:3, :3]
        return flange[:3, 3] + R_e @ np.asarray(tool_offset, dtype=float), R_e
