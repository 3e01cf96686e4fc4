"""The numbers that tell whether a surface is what its maker meant."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.geometry.surfaces.curvature import fundamental_forms
from pfsc_drake.geometry.surfaces.regularity import SampleGrid, sample_grid
from pfsc_drake.geometry.surfaces.surface import Surface

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
        lower_corner: Of the box along the world's axes that holds the samples, [3], m.
        upper_corner: See there.
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
    """Largest curvature towards a side, 1 or -1, 1/m."""
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
    place = surface.wrap(best)
    return 1.0 / largest, (float(place[0]), float(place[1]))


def _sizes(surface: Surface, grid: SampleGrid) -> tuple[float, tuple[float, float]]:
    """Integral of sqrt(E G - F^2), and the largest ones of sqrt(E) and sqrt(G) along lines."""
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    places, shares = [], []
    for k, values in enumerate((grid.theta_1, grid.theta_2)):
        ends = np.append(values, surface.domain[k].end) if surface.closed[k] else values
        half = 0.5 * np.diff(ends)
        places.append((ends[:-1, None] + half[:, None] * (1.0 + nodes)).ravel())
        shares.append((half[:, None] * weights).ravel())
    theta = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1)
    _, first, second = np.moveaxis(surface.partials(theta, 1), -2, 0)
    density = np.linalg.norm(np.cross(first, second), axis=-1)
    along_1 = shares[0] @ np.linalg.norm(first, axis=-1)
    along_2 = np.linalg.norm(second, axis=-1) @ shares[1]
    return float(shares[0] @ density @ shares[1]), (float(along_1.max()), float(along_2.max()))
