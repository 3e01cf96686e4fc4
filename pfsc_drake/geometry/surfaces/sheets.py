"""Check of a surface for self-intersections."""

import numpy as np
from scipy.spatial import cKDTree

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.parametric_surface import Surface
from pfsc_drake.geometry.surfaces.regularity import SampleGrid, sample_grid

# Samples in one direction, and largest number of steps between neighbours.
_MOST_SAMPLES = 96
_NEIGHBOURS = 3
_MOST_PAIRS = 2_000
_ITERATIONS = 12
# Of the surface's extent: points at this distance are the same.
_SAME = 1e-9
# Of the steps between two samples: points closer to each other than that are no crossing.
_APART = 1.5


def check_single_sheet(surface: Surface) -> None:
    """Check that a surface does not meet itself: no crossings, and nothing covered twice.

    Samples that are near to each other, but far in the parameters, are moved until they meet
    (Newton's method). Details below the spacing of samples, see `sample_grid`, may be overlooked.

    Args:
        surface: Surface of class C^1.

    Raises:
        InputError: It meets itself; says at which parameters.
    """
    found = _meeting(surface)
    if found is not None:
        raise InputError(
            f"surface: meets itself at theta = {_pair(found[0])} and {_pair(found[1])}; must be a "
            "single sheet, so take a part of it"
        )


@once_per_content()
def _meeting(surface: Surface) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the parameters at which a surface meets itself, None where it does not."""
    grid = sample_grid(surface)
    strides = [-(-len(values) // _MOST_SAMPLES) for values in (grid.theta_1, grid.theta_2)]
    one, other, steps = _suspects(grid, strides)
    if not len(one):
        return None
    lengths = np.array([ends.length for ends in surface.domain])
    begin = np.array([ends.begin for ends in surface.domain])
    closed = np.array(surface.closed)
    extent = float(np.linalg.norm(np.ptp(grid.position.reshape(-1, 3), axis=0)))
    for _ in range(_ITERATIONS):
        here, there = surface.partials(one, 1), surface.partials(other, 1)
        slopes = np.concatenate([here[:, 1:], -there[:, 1:]], axis=1).transpose(0, 2, 1)
        # In shares of the domain, so that the least change is well defined.
        slopes = slopes * np.tile(lengths, 2)
        gap = here[:, 0] - there[:, 0]
        move = -(np.linalg.pinv(slopes, rcond=1e-9) @ gap[..., None])[..., 0]
        move /= np.maximum(1.0, np.abs(move).max(axis=1, keepdims=True) / 0.1)
        one, other = one + move[:, :2] * lengths, other + move[:, 2:] * lengths
        one, other = (
            np.where(closed, theta, np.clip(theta, begin, begin + lengths))
            for theta in (one, other)
        )
    gap = np.linalg.norm(surface.partials(one, 0) - surface.partials(other, 0), axis=-1)[:, 0]
    apart = np.abs(one - other) / lengths
    apart = np.where(closed, np.abs(apart - np.round(apart)), apart) / steps
    meets = np.flatnonzero((gap < _SAME * extent) & (apart.max(axis=1) > _APART))
    return (one[meets[0]], other[meets[0]]) if len(meets) else None


def _suspects(grid: SampleGrid, strides: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return parameters of near samples that are no neighbours, each [n, 2], and steps [2]."""
    part = (slice(None, None, strides[0]), slice(None, None, strides[1]))
    position, theta = grid.position[part], grid.theta[part]
    shape = np.array(position.shape[:2])
    size = _cell_sizes(position, grid.closed).ravel()
    points = position.reshape(-1, 3)
    near = cKDTree(points).query_ball_point(points, size)
    counts = [len(each) for each in near]
    one, other = np.repeat(np.arange(len(points)), counts), np.concatenate(near).astype(int)
    apart = np.abs(
        np.stack(np.unravel_index(one, shape)) - np.stack(np.unravel_index(other, shape))
    )
    apart = np.where(
        np.array(grid.closed)[:, None], np.minimum(apart, shape[:, None] - apart), apart
    )
    far = (apart.max(axis=0) > _NEIGHBOURS) & (one < other)
    one, other = one[far], other[far]
    # Neighbours are as far apart on the surface as in space, and would crowd out crossings.
    distance = _path_lengths(position, grid.closed, one, other)
    ratio = np.linalg.norm(points[one] - points[other], axis=1) / distance
    nearest = np.argsort(ratio, kind="stable")[:_MOST_PAIRS]
    flat = theta.reshape(-1, 2)
    return flat[one[nearest]], flat[other[nearest]], 1.0 / shape


def _path_lengths(
    position: np.ndarray, closed: tuple[bool, bool], one: np.ndarray, other: np.ndarray
) -> np.ndarray:
    """Return lengths of paths on the surface between samples, first along theta_1, [n]."""
    shape = position.shape[:2]
    begin, end = np.unravel_index(one, shape), np.unravel_index(other, shape)
    corner = (end[0], begin[1])
    total = np.zeros(len(one))
    for axis, (here, there) in enumerate(((begin, corner), (corner, end))):
        steps = np.linalg.norm(np.roll(position, -1, axis=axis) - position, axis=-1)
        revolution = steps.sum(axis=axis)[here[1 - axis]]
        sums = np.cumsum(steps, axis=axis) - steps
        length = np.abs(sums[here] - sums[there])
        total += np.minimum(length, revolution - length) if closed[axis] else length
    return total


def _cell_sizes(position: np.ndarray, closed: tuple[bool, bool]) -> np.ndarray:
    """Return the longest distance from each sample to its four neighbours, [n_1, n_2]."""
    size = np.zeros(position.shape[:2])
    for axis in (0, 1):
        step = np.linalg.norm(np.roll(position, -1, axis=axis) - position, axis=-1)
        step = np.moveaxis(step, axis, 0)
        if not closed[axis]:
            step[-1] = 0.0
        size = np.maximum(size, np.moveaxis(np.maximum(step, np.roll(step, 1, axis=0)), 0, axis))
    return np.sqrt(2.0) * size


def _pair(theta: np.ndarray) -> str:
    return f"[{theta[0]:.6g}, {theta[1]:.6g}]"
