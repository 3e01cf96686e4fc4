"""Samples of a surface, fine enough to see its shape, and whether it is regular there (4.4)."""

import math
from dataclasses import dataclass

import numpy as np

from pfsc_drake.checks import FARTHEST, SHORTEST
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.curvature import fundamental_forms
from pfsc_drake.geometry.surfaces.parametric_surface import Surface

_SAMPLES_PER_CELL = 4
_FEWEST_SAMPLES, _MOST_SAMPLES = 32, 256
# rad, which the normal may turn by from one sample to the next before more are taken, ...
_FINE = 0.25
# ... and above which it is checked for a flip: over ever shorter distances it then ...
_FLIP = math.pi / 2.0
# ... does not turn less than this.
_STILL_TURNS = math.pi / 4.0
_MOST_SUSPECTS, _HALVINGS = 64, 25
# |sigma_1 x sigma_2| over the largest |sigma_1| times the largest |sigma_2|.
_REGULAR = 1e-6
# Relative gap between both ends of a closed direction.
_CLOSED = 1e-6


@dataclass(frozen=True)
class SampleGrid:
    """Samples of a surface on a grid of its parameters.

    Attributes:
        theta_1: Increasing, [n_1]; without the end of a closed direction, as theta_2.
        theta_2: [n_2].
        position: sigma_t, [n_1, n_2, 3], m.
        normal: e_perp (4.3), [n_1, n_2, 3].
        closed: Whether the last sample of a direction is a neighbour of the first.
    """

    theta_1: np.ndarray
    theta_2: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    closed: tuple[bool, bool]

    @property
    def theta(self) -> np.ndarray:
        """Parameters of all samples, [n_1, n_2, 2]."""
        return np.stack(np.meshgrid(self.theta_1, self.theta_2, indexing="ij"), axis=-1)

    def spacing(self, axis: int) -> np.ndarray:
        """Return distances from samples to the next ones along a direction, m."""
        return np.asarray(np.linalg.norm(_differences(self.position, axis, self.closed), axis=-1))

    def turning(self, axis: int) -> np.ndarray:
        """Return angles between normals of samples and of the next ones along a direction, rad."""
        chord = np.linalg.norm(_differences(self.normal, axis, self.closed), axis=-1)
        return np.asarray(2.0 * np.arcsin(np.minimum(1.0, 0.5 * chord)))


def sample_grid(surface: Surface) -> SampleGrid:
    """Sample a surface so that its normal turns little from one sample to the next, and check it.

    Args:
        surface: The surface.

    Returns:
        At least 32 samples in each direction and 4 in each cell; more where the normal turns by
        more than 0.25 rad between two of them, as far as 256.

    Raises:
        InputError: The surface is not regular (4.4), its normal flips, it does not close where it
            should, or its size is unsuitable for robots; says where.
    """
    _refuse_open_seams(surface)
    counts = [_FEWEST_SAMPLES, _FEWEST_SAMPLES]
    while True:
        grid = _sample(surface, counts)
        turning = [float(grid.turning(axis).max()) for axis in (0, 1)]
        finer = [
            min(_MOST_SAMPLES, math.ceil(count * min(4.0, 1.2 * turn / _FINE)))
            if turn > _FINE and count < _MOST_SAMPLES
            else count
            for count, turn in zip(counts, turning, strict=True)
        ]
        if finer == counts:
            _refuse_sizes(grid)
            _refuse_flips(surface, grid)
            return grid
        counts = finer


def check_regular(surface: Surface) -> None:
    """Check that a surface is regular at its samples (4.4) and that its normal does not flip.

    Raises:
        InputError: It is not; says where.
    """
    sample_grid(surface)


def _sample(surface: Surface, counts: list[int]) -> SampleGrid:
    theta_1, theta_2 = (
        surface.grid(_SAMPLES_PER_CELL, count)[axis] for axis, count in enumerate(counts)
    )
    theta = np.stack(np.meshgrid(theta_1, theta_2, indexing="ij"), axis=-1)
    position, first, second = np.moveaxis(surface.partials(theta, 1), -2, 0)
    cross = np.cross(first, second)
    area = np.linalg.norm(cross, axis=-1)
    scale = np.linalg.norm(first, axis=-1).max() * np.linalg.norm(second, axis=-1).max()
    if not np.all(area > _REGULAR * scale):
        where = np.unravel_index(int(np.argmin(area)), area.shape)
        raise InputError(
            f"surface: not regular at theta = {_numbers(theta[where])},"
            f" the point {_numbers(position[where])} m; its tangents must span a plane everywhere"
            " (4.4), so leave out poles, apexes and folds"
        )
    return SampleGrid(theta_1, theta_2, position, cross / area[..., None], surface.closed)


def _refuse_open_seams(surface: Surface) -> None:
    """Refuse a closed direction with different position or tangents at its ends."""
    for axis in (0, 1):
        if not surface.closed[axis]:
            continue
        across = surface.grid(_SAMPLES_PER_CELL, _FEWEST_SAMPLES)[1 - axis]
        ends = []
        for end in surface.domain[axis]:
            theta = np.empty((len(across), 2))
            theta[:, axis], theta[:, 1 - axis] = end, across
            ends.append(surface.partials(theta, 1))
        gap = np.abs(ends[1] - ends[0]).max(axis=2) / np.abs(ends[0]).max(axis=(0, 2))
        if gap.max() > _CLOSED:
            where = across[int(np.argmax(gap.max(axis=1)))]
            raise InputError(
                f"surface: does not close smoothly in theta_{axis + 1} at"
                f" theta_{2 - axis} = {where:.6g}; both ends must have one position and one"
                " tangent plane, or the direction must be open"
            )


def _refuse_sizes(grid: SampleGrid) -> None:
    lengths = [float(grid.spacing(axis).sum(axis=axis).max()) for axis in (0, 1)]
    farthest = float(np.abs(grid.position).max())
    if min(lengths) < SHORTEST or farthest > FARTHEST:
        raise InputError(
            f"surface: {lengths[0]:.3g} m by {lengths[1]:.3g} m, as far as {farthest:.3g} m from"
            f" the origin; at least {SHORTEST:g} m each way, and at most {FARTHEST:g} m away, is"
            " required"
        )


def _refuse_flips(surface: Surface, grid: SampleGrid) -> None:
    """Refuse flips of the normal, found by halving the intervals in which it turns most."""
    for axis in (0, 1):
        turning = grid.turning(axis)
        suspects = np.argwhere(turning > _FLIP)[:_MOST_SUSPECTS]
        if not len(suspects):
            continue
        begin = grid.theta[tuple(suspects.T)]
        values = (grid.theta_1, grid.theta_2)[axis]
        ends = np.append(values, surface.domain[axis].end)
        width = np.diff(ends)[suspects[:, axis]]
        for _ in range(_HALVINGS):
            width = 0.5 * width
            normals = _normals(surface, begin[:, None] + _steps(axis, width))
            first, second = np.linalg.norm(np.diff(normals, axis=1), axis=-1).T
            begin[:, axis] += np.where(second > first, width, 0.0)
        chord = np.maximum(first, second)
        worst = int(np.argmax(chord))
        if chord[worst] > 2.0 * math.sin(0.5 * _STILL_TURNS):
            position = surface.partials(begin[worst], 0)[0]
            raise InputError(
                f"surface: its normal flips at theta = {_numbers(begin[worst])}, the point"
                f" {_numbers(position)} m; it must turn smoothly, without edges and folds"
            )


def _steps(axis: int, width: np.ndarray) -> np.ndarray:
    """Return zero, one and two steps along a direction, [n, 3, 2]."""
    steps = np.zeros((len(width), 3, 2))
    steps[..., axis] = width[:, None] * np.arange(3)
    return steps


def _normals(surface: Surface, theta: np.ndarray) -> np.ndarray:
    _, first, second = np.moveaxis(surface.partials(theta, 1), -2, 0)
    cross = np.cross(first, second)
    # At an irregular point the normal is undefined, which is no flip.
    length = np.linalg.norm(cross, axis=-1, keepdims=True)
    return np.asarray(cross / np.where(length > 0.0, length, 1.0))


def _differences(values: np.ndarray, axis: int, closed: tuple[bool, bool]) -> np.ndarray:
    if closed[axis]:
        return np.roll(values, -1, axis=axis) - values
    return np.diff(values, axis=axis)


def _numbers(values: np.ndarray) -> str:
    return "[" + ", ".join(f"{value:.6g}" for value in values) + "]"


# Gauss-Legendre nodes of the area in each cell of the samples.
_NODES = 4
# A maximum is sought around the best sample on grids that shrink.
_REFINEMENTS, _FINE_SAMPLES, _SHRINK = 8, 9, 3.0

Place = tuple[float, float]


@dataclass(frozen=True)
class SurfaceReport:
    """Numbers of a surface's shape.

    Attributes:
        area: m^2.
        lengths: Longest of the lines along theta_1, and along theta_2, m.
        lower_corner: Lower corner of the samples' box along the world's axes, [3], m.
        upper_corner: Upper corner of that box, [3], m.
        radius_outside: Smallest radius of curvature on the side that e_perp points to, m: how
            far the feasible neighbourhood (4.13) reaches there; infinite where the surface does
            not bend to that side.
        radius_outside_at: theta there, or None.
        radius_inside: The same on the other side.
        radius_inside_at: theta there, or None.
        smallest_angle: Smallest angle between the tangents (4.2), rad.
    """

    area: float
    lengths: tuple[float, float]
    lower_corner: np.ndarray
    upper_corner: np.ndarray
    radius_outside: float
    radius_outside_at: Place | None
    radius_inside: float
    radius_inside_at: Place | None
    smallest_angle: float


def surface_report(surface: Surface) -> SurfaceReport:
    """Measure a surface's shape.

    Args:
        surface: Regular surface of class C^2.

    Returns:
        The numbers.

    Raises:
        InputError: The surface is not regular (4.4).
    """
    grid = sample_grid(surface)
    forms = fundamental_forms(surface, grid.theta)
    cosine = np.abs(forms.F) / np.sqrt(forms.E * forms.G)
    flat = grid.position.reshape(-1, 3)
    area, lengths = _sizes(surface, grid)
    outside, outside_at = _smallest_radius(surface, grid, 1.0)
    inside, inside_at = _smallest_radius(surface, grid, -1.0)
    return SurfaceReport(
        area=area,
        lengths=lengths,
        lower_corner=flat.min(axis=0),
        upper_corner=flat.max(axis=0),
        radius_outside=outside,
        radius_outside_at=outside_at,
        radius_inside=inside,
        radius_inside_at=inside_at,
        smallest_angle=float(np.arccos(np.minimum(1.0, cosine)).min()),
    )


def _curvature(surface: Surface, theta: np.ndarray, side: float) -> np.ndarray:
    """Return the largest curvature towards a side, 1 or -1, 1/m."""
    largest, smallest = fundamental_forms(surface, theta).principal_curvatures
    return np.asarray(largest if side > 0.0 else -smallest)


def _smallest_radius(surface: Surface, grid: SampleGrid, side: float) -> tuple[float, Place | None]:
    theta = grid.theta
    window = [
        ends.length / len(n)
        for ends, n in zip(surface.domain, (grid.theta_1, grid.theta_2), strict=True)
    ]
    extent = float(np.linalg.norm(np.ptp(grid.position.reshape(-1, 3), axis=0)))
    for _ in range(_REFINEMENTS):
        curvature = _curvature(surface, theta, side)
        where = np.unravel_index(int(np.argmax(curvature)), curvature.shape)
        best, largest = theta[where], float(curvature[where])
        axes = []
        for k, (ends, closed) in enumerate(zip(surface.domain, surface.closed, strict=True)):
            values = best[k] + np.linspace(-window[k], window[k], _FINE_SAMPLES)
            axes.append(values if closed else np.clip(values, *ends))
        theta = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        window = [width / _SHRINK for width in window]
    # Rounding errors bend even a plane.
    if largest * extent < 1e-9:
        return np.inf, None
    wrapped = surface.wrap(best)
    return 1.0 / largest, (float(wrapped[0]), float(wrapped[1]))


def _sizes(surface: Surface, grid: SampleGrid) -> tuple[float, tuple[float, float]]:
    """Return integrals of sqrt(E G - F^2), and the largest of sqrt(E) and sqrt(G) along lines."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    sites, shares = [], []
    for k, values in enumerate((grid.theta_1, grid.theta_2)):
        ends = np.append(values, surface.domain[k].end) if surface.closed[k] else values
        half = 0.5 * np.diff(ends)
        sites.append((ends[:-1, None] + half[:, None] * (1.0 + nodes)).ravel())
        shares.append((half[:, None] * weights).ravel())
    theta = np.stack(np.meshgrid(*sites, indexing="ij"), axis=-1)
    _, first, second = np.moveaxis(surface.partials(theta, 1), -2, 0)
    density = np.linalg.norm(np.cross(first, second), axis=-1)
    along_1 = shares[0] @ np.linalg.norm(first, axis=-1)
    along_2 = np.linalg.norm(second, axis=-1) @ shares[1]
    return float(shares[0] @ density @ shares[1]), (float(along_1.max()), float(along_2.max()))
