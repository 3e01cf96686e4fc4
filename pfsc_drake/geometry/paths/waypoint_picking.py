"""Waypoints picked from the motion of a tool that was led along a path."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.rotation import matrix_to_quaternion

# Of the spacing: what a tool does that nearly rests is no path.
_LEAST = 0.5
# Of the spacing: how far from its begin a closed path may end.
_CLOSING = 3.0
# rad, between neighbours; about as much as a tool can turn on such a way.
_LARGEST_TURN = np.deg2rad(20.0)
_WINDOW = 2048


@dataclass(frozen=True)
class Picking:
    """How densely waypoints are picked.

    Attributes:
        spacing: Distance from the last waypoint from which on the next is taken, m.
        angle: Turn since the last waypoint from which on the next is taken, rad, once the tool has
            moved by half the spacing.
        closed: Whether the tool was led back to where it began.
    """

    spacing: float
    angle: float
    closed: bool = False


def pick_waypoints(
    positions: np.ndarray, rotations: np.ndarray | None, picking: Picking
) -> np.ndarray:
    """Pick samples of a motion as waypoints of a path.

    The first sample is one, then each that is as far away from the last one picked, or turned as
    far, as `picking` says, and the last sample. So a tool at rest adds none, however long it
    rests and whatever its noise, if that is below the spacing. Samples that are not finite are
    passed over. Nothing is smoothed.

    A closed path ends where the tool comes nearest to its begin; a lap that goes on is cut there.

    Args:
        positions: Positions of the tool point, m, [n, 3].
        rotations: Rotations of the tool, [n, 3, 3], or None.
        picking: How densely.

    Returns:
        Increasing indices of the samples.

    Raises:
        InputError: The tool never moved, turned where it stood, or did not come back to the
            begin of a closed path.
    """
    known = np.isfinite(positions).all(axis=1)
    if rotations is not None:
        known &= np.isfinite(rotations).all(axis=(1, 2))
    samples = np.flatnonzero(known)
    if samples.size == 0:
        raise InputError("taught motion: no sample with a finite position of the tool")
    way = _Way(positions[samples], rotations if rotations is None else rotations[samples])
    rows = _ended(way, _picked(way, picking), picking.spacing)
    if len(rows) < 2:
        raise InputError(
            "nothing was taught: the tool never went further than "
            f"{way.distances(0, slice(None)).max():.2g} m from where it was, and a waypoint is"
            f" taken every {picking.spacing:g} m"
        )
    if picking.closed:
        rows = _closed(way, rows, picking.spacing)
    _check_turns(way, rows, picking.closed)
    return samples[rows]


class _Way:
    """Distances and angles between samples."""

    def __init__(self, positions: np.ndarray, rotations: np.ndarray | None) -> None:
        self.positions = positions
        self._quaternions = None if rotations is None else matrix_to_quaternion(rotations)

    def __len__(self) -> int:
        return len(self.positions)

    def distances(self, i: int, others: slice | list[int]) -> np.ndarray:
        """From sample i, m."""
        return np.asarray(np.linalg.norm(self.positions[others] - self.positions[i], axis=1))

    def angles(self, i: int, others: slice | list[int]) -> np.ndarray:
        """From sample i, rad; zero without orientation."""
        if self._quaternions is None:
            return np.zeros(len(self.positions[others]))
        cosines = np.abs(self._quaternions[others] @ self._quaternions[i])
        return np.asarray(2.0 * np.arccos(np.minimum(cosines, 1.0)))


def _picked(way: _Way, picking: Picking) -> list[int]:
    """The first sample and all that are far enough from the last one picked."""
    rows, begin = [0], 1
    while begin < len(way):
        window = slice(begin, begin + _WINDOW)
        distance = way.distances(rows[-1], window)
        turned = way.angles(rows[-1], window) >= picking.angle
        turned &= distance >= _LEAST * picking.spacing
        far = np.flatnonzero((distance >= picking.spacing) | turned)
        if far.size:
            rows.append(begin + int(far[0]))
        begin = rows[-1] + 1 if far.size else begin + _WINDOW
    return rows


def _ended(way: _Way, rows: list[int], spacing: float) -> list[int]:
    """The same with the last sample, in place of the last pick if that is near."""
    end = len(way) - 1
    if len(rows) < 2 or rows[-1] == end:
        return rows
    if way.distances(end, [rows[-1]])[0] >= 0.5 * spacing:
        return [*rows, end]
    if way.distances(end, [rows[-2]])[0] >= _LEAST * spacing:
        return [*rows[:-1], end]
    return rows


def _closed(way: _Way, rows: list[int], spacing: float) -> list[int]:
    """One lap, whose last point is not its first."""
    gap, most = way.distances(0, rows), _CLOSING * spacing
    away = np.flatnonzero(gap > most)
    back = np.flatnonzero(gap[away[0] :] <= most) + away[0] if away.size else away
    if not back.size:
        where = f"ended {gap[-1]:.2g} m from where it began" if away.size else "went nowhere"
        raise InputError(f"closed path: the tool {where}; allowed: it comes back to {most:g} m")
    # only the first time that it comes by
    left = np.flatnonzero(np.diff(back) > 1)
    by = back[: left[0] + 1] if left.size else back
    last = int(by[np.argmin(gap[by])])
    while gap[last] < 0.5 * spacing:
        last -= 1
    return rows[: last + 1]


def _check_turns(way: _Way, rows: list[int], closed: bool) -> None:
    """Refuse an orientation that a path cannot turn along its way."""
    pairs = list(zip(rows, [*rows[1:], rows[0]] if closed else rows[1:], strict=False))
    for number, (one, other) in enumerate(pairs, start=1):
        turn = float(way.angles(one, [other])[0])
        if turn > _LARGEST_TURN:
            way_there = float(way.distances(one, [other])[0])
            raise InputError(
                f"taught path: the tool turned by {np.rad2deg(turn):.3g} deg within"
                f" {way_there:.2g} m, after waypoint {number}; allowed: up to"
                f" {np.rad2deg(_LARGEST_TURN):g} deg between neighbours: move it while turning it"
            )
