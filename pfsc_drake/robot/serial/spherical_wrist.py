"""Inverse kinematics of six-axis robots with a spherical wrist, eqs. (2.9) and (2.10)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.denavit_hartenberg import DenavitHartenberg

_TWISTS = np.deg2rad([90.0, 0.0, 90.0, -90.0, 90.0, 0.0])
_ZERO_OFFSETS = {"d": (1, 2, 4), "a": (3, 4, 5)}
_LIMIT_TOLERANCE = 1e-9  # rad; a limit missed by rounding counts as reached
_SINGULAR = 1e-10  # below this sine (or distance from axis 1 in m) the direction is not defined
_REACH_TOLERANCE = 1e-12  # of the cosine of the elbow angle
_ROTATION_TOLERANCE = 1e-6

Vector = Sequence[float] | np.ndarray


@dataclass(frozen=True, eq=False)
class Branch:
    """One of the postures that reach a pose.

    Attributes:
        q: ``[6]`` joint angles [rad].
        violation: ``[6]`` by how much they are beyond their limits [rad]; zero within.
        shoulder: ``front`` or ``back``, whether it is turned towards the wrist centre; ``open`` if
            that lies on axis 1.
        elbow: ``up`` or ``down``, above or below the line from the shoulder to the wrist centre.
        wrist: ``positive`` or ``flipped``, the sign of ``theta_5``; ``straight`` if that is 0.
    """

    q: np.ndarray
    violation: np.ndarray
    shoulder: str
    elbow: str
    wrist: str

    @property
    def is_within_limits(self) -> bool:
        """Whether all joints are within their limits, but for rounding."""
        return bool(np.all(self.violation <= _LIMIT_TOLERANCE))

    @property
    def is_singular(self) -> bool:
        """Whether an angle of it is a preference, of many that reach the pose."""
        return self.shoulder == "open" or self.wrist == "straight"


@dataclass(frozen=True, eq=False)
class SphericalWrist:
    """All joint angles of a six-axis robot with spherical wrist that reach a pose.

    For the DH structure of Tab. 2.1: twists (90, 0, 90, -90, 90, 0) deg and
    ``d_2 = d_3 = d_5 = a_4 = a_5 = a_6 = 0``; the other lengths are free.

    The wrist centre follows from (2.9), ``y_WCP = y_t - R_e [x_6T, y_6T, z_6T + d_6]'``. Up to
    eight branches reach it: shoulder turned to the front or to the back, elbow up or down, wrist
    with ``theta_5 > 0`` or flipped, ``(theta_4 + pi, -theta_5, theta_6 + pi)``. The dissertation
    prints the branch front, elbow up, ``0 < theta_5 < pi`` in (2.10). Errata there: ``c_ik`` needs
    ``b_ik`` instead of ``b_3``, and (2.10e) is an ``atan2``; ``arctan(s_ik / r_ik)`` in (2.10b)
    must be an ``atan2``, too, once the wrist centre lies behind the shoulder (``r_ik < 0``).

    Where an angle is not defined it comes from a preference: ``theta_1`` if the wrist centre lies
    on axis 1, ``theta_4`` if axes 4 and 6 are collinear (``theta_5 = 0``).

    Attributes:
        table: the DH table.
        lower: ``[6]`` smallest joint angles [rad].
        upper: ``[6]`` largest joint angles [rad].
        tool_offset: ``[3]`` tool point ``[x_6T, y_6T, z_6T]`` in DH frame 6 [m].
    """

    table: DenavitHartenberg
    lower: np.ndarray
    upper: np.ndarray
    tool_offset: np.ndarray

    def __post_init__(self) -> None:
        _require_structure(self.table)
        for name, size in (("lower", 6), ("upper", 6), ("tool_offset", 3)):
            object.__setattr__(self, name, _finite(name, getattr(self, name), (size,)))
        if not np.all(self.lower < self.upper):
            raise InputError(f"lower limits {self.lower}: must be less than upper {self.upper}")

    def solutions(
        self, y_t: Vector, R_e: np.ndarray, *, preference: Vector = (0,) * 6
    ) -> np.ndarray:
        """Returns all branches within the limits.

        Args:
            y_t: ``[3]`` tool point in the base frame [m].
            R_e: ``[3, 3]`` rotation from DH frame 6 to the base frame.
            preference: ``[6]`` angles that stand in where a singularity leaves them open [rad].

        Returns:
            ``[k, 6]`` joint angles [rad], 1 <= k <= 8, one row per branch, front before back, elbow
            up before down, ``theta_5 > 0`` before flipped. Each angle is the one nearest to the
            middle of its limits among those that differ by ``2 pi``.

        Raises:
            InputError: if the pose is out of reach, or if every branch violates a limit.
        """
        found = self.branches(y_t, R_e, preference=preference)
        allowed = [branch.q for branch in found if branch.is_within_limits]
        if not allowed:
            where = np.asarray(y_t, dtype=float).tolist()
            raise InputError(f"pose at y_t = {where} m: {self._describe_limits(found)}")
        return np.clip(allowed, self.lower, self.upper)

    def branches(
        self, y_t: Vector, R_e: np.ndarray, *, preference: Vector = (0,) * 6
    ) -> list[Branch]:
        """Returns all branches, whether within the limits or not, in the order of solutions.

        Args:
            y_t: ``[3]`` tool point in the base frame [m].
            R_e: ``[3, 3]`` rotation from DH frame 6 to the base frame.
            preference: ``[6]`` angles that stand in where a singularity leaves them open [rad].

        Raises:
            InputError: if the pose is out of reach.
        """
        y_t, R_e = _finite("y_t", y_t, (3,)), _finite("R_e", R_e, (3, 3))
        preference = _finite("preference", preference, (6,))
        if np.abs(R_e.T @ R_e - np.eye(3)).max() > _ROTATION_TOLERANCE or np.linalg.det(R_e) < 0:
            raise InputError(f"R_e = {R_e.tolist()}: must be a rotation matrix")
        wrist_offset = self.tool_offset + np.array([0.0, 0.0, self.table.d[5]])
        y_wcp = y_t - R_e @ wrist_offset  # (2.9)
        found = []
        for shoulder, elbow, arm in self._arm_angles(y_wcp, preference[0]):
            for wrist, angles in _wrist_angles(self._R_36(arm, R_e), preference[3]):
                q = self._unwrap(np.concatenate([arm, angles]))
                violation = np.maximum(np.maximum(self.lower - q, q - self.upper), 0.0)
                found.append(Branch(q, violation, shoulder, elbow, wrist))
        return found

    def closest(self, y_t: Vector, R_e: np.ndarray, q_reference: Vector) -> np.ndarray:
        """Returns the solution within the limits that is closest to a reference.

        Args:
            y_t: ``[3]`` tool point in the base frame [m].
            R_e: ``[3, 3]`` rotation from DH frame 6 to the base frame.
            q_reference: ``[6]`` joint angles [rad]; also stand in at singularities.

        Returns:
            ``[6]`` joint angles [rad] with the least sum of squared differences from the reference.

        Raises:
            InputError: as :meth:`solutions`.
        """
        reference = _finite("q_reference", q_reference, (6,))
        found = self.solutions(y_t, R_e, preference=reference)
        # Full turns that stay within the limits, towards the reference; turns away never help.
        room = np.where(found < reference, self.upper - found, found - self.lower)
        turns = np.floor((np.maximum(room, 0.0) + _LIMIT_TOLERANCE) / (2 * np.pi))
        wanted = np.abs(np.round((reference - found) / (2 * np.pi)))
        found = found + np.sign(reference - found) * 2 * np.pi * np.minimum(turns, wanted)
        distance = np.sum((found - reference) ** 2, axis=1)
        return np.clip(found[np.argmin(distance)], self.lower, self.upper)

    def _arm_angles(
        self, y_wcp: np.ndarray, theta_1_open: float
    ) -> list[tuple[str, str, np.ndarray]]:
        """Returns shoulder, elbow and theta_1..3 of all that reach the wrist centre, (2.10a-c)."""
        a_1, a_2, a_3 = self.table.a[:3]
        d_1, d_4 = self.table.d[[0, 3]]
        rho, s_ik = np.hypot(y_wcp[0], y_wcp[1]), y_wcp[2] - d_1
        b_ik, gamma_ik = np.hypot(a_3, d_4), np.arctan2(a_3, d_4)
        if rho > _SINGULAR:
            front = np.arctan2(y_wcp[1], y_wcp[0])
            shoulders = [("front", front, rho - a_1), ("back", front + np.pi, -rho - a_1)]
        else:
            shoulders = [("open", theta_1_open, -a_1)]
        found, distances = [], []
        for shoulder, theta_1, r_ik in shoulders:
            distances.append(np.hypot(r_ik, s_ik))
            c_ik = (a_2**2 + b_ik**2 - r_ik**2 - s_ik**2) / (2 * a_2 * b_ik)
            if abs(c_ik) > 1 + _REACH_TOLERANCE:
                continue
            inner = np.arccos(np.clip(c_ik, -1.0, 1.0))  # between upper arm and forearm
            # a turn of the upper arm against the line to the wrist centre lifts it in front only
            up = inner if r_ik >= 0.0 else -inner
            for elbow, bend in (("up", up), ("down", -up)):
                theta_3 = bend - gamma_ik - np.pi / 2
                theta_2 = np.arctan2(s_ik, r_ik) + np.arctan2(
                    b_ik * np.cos(theta_3 + gamma_ik), a_2 + b_ik * np.sin(theta_3 + gamma_ik)
                )
                found.append((shoulder, elbow, np.array([theta_1, theta_2, theta_3])))
        if not found:
            shown = " or ".join(f"{distance:.4f}" for distance in distances)
            reach = f"{abs(a_2 - b_ik):.4f} to {a_2 + b_ik:.4f} m"
            raise InputError(
                f"wrist centre {np.round(y_wcp, 4).tolist()} m: {shown} m from the shoulder "
                f"(front or back): must be {reach}"
            )
        return found

    def _R_36(self, arm: np.ndarray, R_e: np.ndarray) -> np.ndarray:
        R_03 = self.table.link_poses(np.concatenate([arm, np.zeros(3)]))[3, :3, :3]
        return R_03.T @ R_e

    def _unwrap(self, q: np.ndarray) -> np.ndarray:
        """Returns the equivalent angles nearest to the middle of the limits."""
        middle = 0.5 * (self.lower + self.upper)
        return q - 2 * np.pi * np.round((q - middle) / (2 * np.pi))

    def _describe_limits(self, branches: list[Branch]) -> str:
        """Names the worst joint of the branch that comes nearest to the limits."""
        nearest = min(branches, key=lambda branch: float(branch.violation.max()))
        joint = int(np.argmax(nearest.violation))
        value, lower, upper = np.rad2deg([nearest.q[joint], self.lower[joint], self.upper[joint]])
        return (
            f"all {len(branches)} branches violate a limit; in the nearest one theta_{joint + 1} = "
            f"{value:.2f} deg: must be {lower:g} to {upper:g} deg"
        )


def _wrist_angles(R_36: np.ndarray, theta_4_open: float) -> list[tuple[str, np.ndarray]]:
    """Returns names and theta_4..6 of both branches, (2.10d-f), from R_36 = Rz Ry Rz."""
    sine = np.hypot(R_36[0, 2], R_36[1, 2])
    regular = sine > _SINGULAR
    theta_4 = np.arctan2(R_36[1, 2], R_36[0, 2]) if regular else theta_4_open
    theta_5 = np.arctan2(sine, R_36[2, 2])
    # (2.10f) loses theta_6 near theta_5 = 0. The second row of Rz(-theta_4) R_36 = Ry Rz holds it
    # whatever theta_5 is, and matches the theta_4 that was chosen.
    s_6, c_6 = np.array([-np.sin(theta_4), np.cos(theta_4)]) @ R_36[:2, :2]
    theta_6 = np.arctan2(s_6, c_6)
    angles = np.array([theta_4, theta_5, theta_6])
    if not regular:
        return [("straight", angles)]
    flipped = np.array([theta_4 + np.pi, -theta_5, theta_6 + np.pi])
    return [("positive", angles), ("flipped", flipped)]


def _finite(name: str, value: Vector, shape: tuple[int, ...]) -> np.ndarray:
    array = np.asarray(value, dtype=float)
    if array.shape != shape or not np.all(np.isfinite(array)):
        raise InputError(f"{name} = {array.tolist()}: must be finite numbers of shape {shape}")
    return array


def _require_structure(table: DenavitHartenberg) -> None:
    """Refuses tables that do not have the structure of Tab. 2.1."""
    if table.axes != 6 or np.abs(table.alpha - _TWISTS).max() > _SINGULAR:
        twists = np.rad2deg(table.alpha).tolist()
        raise InputError(f"DH alpha = {twists} deg: must be {np.rad2deg(_TWISTS).tolist()} deg")
    for name, rows in _ZERO_OFFSETS.items():
        for i in rows:
            if getattr(table, name)[i] != 0.0:
                raise InputError(f"DH {name}_{i + 1} = {getattr(table, name)[i]} m: must be 0")
    if not (table.a[1] > 0 and np.hypot(table.a[2], table.d[3]) > 0):
        raise InputError(f"DH a_2 = {table.a[1]} m: must be positive, as the forearm's length")
