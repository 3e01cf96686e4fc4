"""Waypoints picked from the motion of a tool that was guided along a path."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.rotation import matrix_to_quaternion

# Of the spacing: motions of a tool that nearly rests are no path.
_LEAST = 0.5
# Of the spacing: largest distance between the ends of a closed path.
_CLOSING = 3.0
# rad, between neighbours; about the largest turn of a tool over such a distance.
_LARGEST_TURN = np.deg2rad(20.0)
_WINDOW = 2048


@dataclass(frozen=True)
class Picking:
    """Density of the picked waypoints.

    Attributes:
        spacing: Distance from the last waypoint at which the next is taken, m.
        angle: Turn since the last waypoint at which the next is taken, rad, once the tool has
            moved by half the spacing.
        closed: Whether the tool was guided back to its start.
    """

    spacing: float
    angle: float
    closed: bool = False


def pick_waypoints(
    positions: np.ndarray, rotations: np.ndarray | None, picking: Picking
) -> np.ndarray:
    """Pick samples of a motion as waypoints of a path.

    Waypoints are the first sample, then each sample whose distance or turn from the last waypoint
    reaches `picking`, and the last sample. A tool at rest adds none, however long it rests, as long
    as its noise is below the spacing. NaN or infinite samples are skipped. Nothing is smoothed.

    A closed path ends where the tool comes nearest to its begin; further motion is cut off there.

    Args:
        positions: Positions of the tool point, m, [n, 3].
        rotations: Rotations of the tool, [n, 3, 3], or None.
        picking: Density of the waypoints.

    Returns:
        Increasing indices of the samples.

    Raises:
        InputError: The tool never moved, turned without moving, or did not come back to the
            begin of a closed path.
    """
    known = np.isfinite(positions).all(axis=1)
    if rotations is not None:
        known &= np.isfinite(rotations).all(axis=(1, 2))
    samples = np.flatnonzero(known)
    if samples.size == 0:
        raise InputError("taught motion: no sample with a finite position of the tool")
    motion = _Motion(positions[samples], rotations if rotations is None else rotations[samples])
    rows = _with_end(motion, _pick(motion, picking), picking.spacing)
    if len(rows) < 2:
        raise InputError(
            "nothing was taught: the tool never went further than "
            f"{motion.distances(0, slice(None)).max():.2g} m from where it was, and a waypoint is"
            f" taken every {picking.spacing:g} m"
        )
    if picking.closed:
        rows = _one_revolution(motion, rows, picking.spacing)
    _check_turns(motion, rows, picking.closed)
    return samples[rows]


class _Motion:
    """Distances and angles between samples."""

    def __init__(self, positions: np.ndarray, rotations: np.ndarray | None) -> None:
        self.positions = positions
        self._quaternions = None if rotations is None else matrix_to_quaternion(rotations)

    def __len__(self) -> int:
        return len(self.positions)

    def distances(self, i: int, others: slice | list[int]) -> np.ndarray:
        """Return distances from sample i, m."""
        return np.asarray(np.linalg.norm(self.positions[others] - self.positions[i], axis=1))

    def angles(self, i: int, others: slice | list[int]) -> np.ndarray:
        """Return angles from sample i, rad; zero without orientation."""
        if self._quaternions is None:
            return np.zeros(len(self.positions[others]))
        cosines = np.abs(self._quaternions[others] @ self._quaternions[i])
        return np.asarray(2.0 * np.arccos(np.minimum(cosines, 1.0)))


def _pick(motion: _Motion, picking: Picking) -> list[int]:
    """Return the first sample and all that are far enough from the last one picked."""
    rows, begin = [0], 1
    while begin < len(motion):
        window = slice(begin, begin + _WINDOW)
        distance = motion.distances(rows[-1], window)
        turned = motion.angles(rows[-1], window) >= picking.angle
        turned &= distance >= _LEAST * picking.spacing
        far = np.flatnonzero((distance >= picking.spacing) | turned)
        if far.size:
            rows.append(begin + int(far[0]))
        begin = rows[-1] + 1 if far.size else begin + _WINDOW
    return rows


def _with_end(motion: _Motion, rows: list[int], spacing: float) -> list[int]:
    """Return the rows with the last sample, in place of the last pick if that is near."""
    end = len(motion) - 1
    if len(rows) < 2 or rows[-1] == end:
        return rows
    if motion.distances(end, [rows[-1]])[0] >= 0.5 * spacing:
        return [*rows, end]
    if motion.distances(end, [rows[-2]])[0] >= _LEAST * spacing:
        return [*rows[:-1], end]
    return rows


def _one_revolution(motion: _Motion, rows: list[int], spacing: float) -> list[int]:
    """Return the rows of one revolution, whose last point is not its first."""
    gap, most = motion.distances(0, rows), _CLOSING * spacing
    away = np.flatnonzero(gap > most)
    back = np.flatnonzero(gap[away[0] :] <= most) + away[0] if away.size else away
    if not back.size:
        where = f"ended {gap[-1]:.2g} m from where it began" if away.size else "went nowhere"
        raise InputError(f"closed path: the tool {where}; allowed: it comes back to {most:g} m")
    # only the first return
    left = np.flatnonzero(np.diff(back) > 1)
    by = back[: left[0] + 1] if left.size else back
    last = int(by[np.argmin(gap[by])])
    while gap[last] < 0.5 * spacing:
        last -= 1
    return rows[: last + 1]


def _check_turns(motion: _Motion, rows: list[int], closed: bool) -> None:
    """Refuse an orientation that turns too fast along a path."""
    pairs = list(zip(rows, [*rows[1:], rows[0]] if closed else rows[1:], strict=False))
    for number, (one, other) in enumerate(pairs, start=1):
        turn = float(motion.angles(one, [other])[0])
        if turn > _LARGEST_TURN:
            distance = float(motion.distances(one, [other])[0])
            raise InputError(
                f"taught path: the tool turned by {np.rad2deg(turn):.3g} deg within"
                f" {distance:.2g} m, after waypoint {number}; allowed: up to"
                f" {np.rad2deg(_LARGEST_TURN):g} deg between neighbours: move it while turning it"
            )
