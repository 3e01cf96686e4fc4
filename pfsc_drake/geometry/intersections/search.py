"""Where on two or three surfaces to look for places that they have in common."""

import itertools
from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.intersections.meeting import Meeting
from pfsc_drake.geometry.surfaces.regularity import SampleGrid, sample_grid
from pfsc_drake.geometry.surfaces.surface import Surface

# Radius of the ball around a sample over half of the diagonal to its neighbours: surfaces bend.
_MARGIN = 1.25
# More starts would take long; that many are there where surfaces coincide.
_MOST_STARTS = 20_000


def starts(surfaces: Sequence[Surface]) -> np.ndarray:
    """Parameters of samples that are so near that their surfaces may meet between them.

    Samples are as fine as :func:`sample_grid` makes them; what is of all surfaces lies in
    the balls around one sample of each.

    Args:
        surfaces: m = 2 or 3.

    Returns:
        Shape [n, 2 m], at most 20,000.

    Raises:
        InputError: The surfaces are everywhere farther from each other; says how far.
    """
    grids = [sample_grid(surface) for surface in surfaces]
    points = [grid.position.reshape(-1, 3) for grid in grids]
    radii = [_radii(grid).ravel() for grid in grids]
    theta = [grid.theta.reshape(-1, 2) for grid in grids]
    near = [_near(points[0], radii[0], points[k], radii[k]) for k in range(1, len(grids))]
    rows = []
    for first, others in enumerate(zip(*near, strict=True)):
        for group in itertools.product(*others):
            if len(group) < 2 or _touch(points, radii, group):
                rows.append((first, *group))
    if not rows:
        raise InputError(_apart(points))
    table = np.array(rows)
    table = table[:: -(-len(table) // _MOST_STARTS)]
    return np.hstack([own[column] for own, column in zip(theta, table.T, strict=True)])


def distinct(meeting: Meeting, theta: np.ndarray, distance: float) -> np.ndarray:
    """Parameters [n, 2 m] of which no two places are nearer than a distance [m], the first kept."""
    places = meeting.partials(theta, 0)[0, :, 0]
    kept: list[int] = []
    for row, place in enumerate(places):
        if not kept or np.linalg.norm(places[kept] - place, axis=1).min() > distance:
            kept.append(row)
    return theta[kept]


def _radii(grid: SampleGrid) -> np.ndarray:
    """Radii of balls around samples that hold the surface between them, [n_1, n_2]."""
    square = np.zeros(grid.position.shape[:2])
    for axis in (0, 1):
        step = np.moveaxis(grid.spacing(axis), axis, 0)
        if not grid.closed[axis]:
            step = np.concatenate([step[:1], step, step[-1:]])
            longest = np.maximum(step[1:], step[:-1])
        else:
            longest = np.maximum(step, np.roll(step, 1, axis=0))
        square += np.moveaxis(longest, 0, axis) ** 2
    return np.asarray(_MARGIN * 0.5 * np.sqrt(square))


def _near(one: np.ndarray, r: np.ndarray, other: np.ndarray, s: np.ndarray) -> list[list[int]]:
    """For each ball around the points of one those of another, by radius, that it meets."""
    found = cKDTree(other).query_ball_point(one, r + s.max())
    return [
        [j for j in near if np.linalg.norm(one[i] - other[j]) <= r[i] + s[j]] if near else []
        for i, near in enumerate(found)
    ]


def _touch(points: list[np.ndarray], radii: list[np.ndarray], group: tuple[int, ...]) -> bool:
    """Whether the balls of the second and the third surface meet, too."""
    j, k = group
    return bool(np.linalg.norm(points[1][j] - points[2][k]) <= radii[1][j] + radii[2][k])


def _apart(points: list[np.ndarray]) -> str:
    far = np.max([cKDTree(other).query(points[0])[0] for other in points[1:]], axis=0)
    return (
        f"surfaces: do not meet within their bounds, {far.min():.3g} m between their nearest "
        "samples; larger or other ones are required"
    )
