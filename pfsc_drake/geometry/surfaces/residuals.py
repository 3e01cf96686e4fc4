"""Distances of points from a surface."""

from dataclasses import dataclass

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.partials import partial_index
from pfsc_drake.geometry.surfaces.surface import Surface

_STEPS = 12
# Of a parameter relative to its domain.
_CONVERGED = 1e-13
# A stray point is so many standard deviations away, and so many spacings.
_STRAY, _STRAY_SPACINGS = 10.0, 0.1
# Median of the absolute value of a normal random number of deviation one.
_MEDIAN_OF_NORMAL = 0.6745
# Mean of the absolute value over the root mean square: 0.80 of normal noise, 1 of two sheets.
_TWO_SHEETS = 0.93


@dataclass(frozen=True)
class Residuals:
    """Where points stand relative to a surface.

    Attributes:
        theta: Parameters of the nearest points of the surface, [n, 2].
        distances: Distances along the normal (4.3), positive on its side, m, [n].
    """

    theta: np.ndarray
    distances: np.ndarray

    @property
    def rms(self) -> float:
        """Root mean square of the distances, m."""
        return float(np.sqrt(np.mean(self.distances**2)))

    @property
    def largest(self) -> float:
        """Largest distance, m."""
        return float(np.abs(self.distances).max())


def residuals(surface: Surface, points: np.ndarray, theta: np.ndarray) -> Residuals:
    """Distances of points from a surface.

    Args:
        surface: The surface.
        points: [n, 3], m, near it.
        theta: Guesses of their parameters, [n, 2].

    Returns:
        The residuals; of points beyond an end their distances along the normal there.
    """
    place = np.array(theta, dtype=float)
    lengths = np.array([side.length for side in surface.domain])
    for _ in range(_STEPS):
        error, first, second, gradient, hessian = _foot(surface, points, place)
        step = np.linalg.solve(hessian, gradient[..., None])[..., 0]
        new = place + step
        for k, side in enumerate(surface.domain):
            if not surface.closed[k]:
                new[:, k] = np.clip(new[:, k], side.begin, side.end)
        moved = np.abs(new - place).max(axis=0)
        place = new
        if np.all(moved <= _CONVERGED * lengths):
            break
    error, first, second, _, _ = _foot(surface, points, place)
    normals = np.cross(first, second)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Residuals(surface.wrap(place), np.sum(error * normals, axis=1))


def check_scatter(
    left: Residuals, points: np.ndarray, spacing: float, tolerance: float | None
) -> None:
    """Refuse points of two sheets, and without a tolerance those far away from all others.

    Args:
        left: Residuals of the points.
        points: [n, 3], m.
        spacing: Distance at which they stand, m.
        tolerance: Whether the user has said how far points may be away.
    """
    distances = np.abs(left.distances)
    if left.rms > _STRAY_SPACINGS * spacing and distances.mean() > _TWO_SHEETS * left.rms:
        raise InputError(
            f"surface points: lie {distances.mean():.3g} m to either side of the surface fitted,"
            " none on it; points of a single sheet are required"
        )
    usual = float(np.median(distances)) / _MEDIAN_OF_NORMAL
    worst = int(np.argmax(distances))
    stray = distances[worst] > max(_STRAY * usual, _STRAY_SPACINGS * spacing)
    if tolerance is None and stray:
        raise InputError(
            f"surface points: number {worst + 1} of those fitted,"
            f" [{', '.join(f'{value:.6g}' for value in points[worst])}] m, is"
            f" {distances[worst]:.3g} m away from the surface, the others {usual:.3g} m: take it"
            " out, or give a tolerance"
        )


def _foot(
    surface: Surface, points: np.ndarray, theta: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Error y - sigma, both tangents, half the slope of its square and the Hessian's main part."""
    rows = surface.partials(theta, 1)
    error = points - rows[:, 0]
    tangents = rows[:, [partial_index(1, 0), partial_index(0, 1)]]
    gradient = np.einsum("nki,ni->nk", tangents, error)
    metric = np.einsum("nki,nli->nkl", tangents, tangents)
    return error, tangents[:, 0], tangents[:, 1], gradient, metric
