"""Parameters at which surfaces meet: one system of equations, solved by Newton's method."""

from collections.abc import Sequence

import numpy as np

from pfsc_drake.geometry.surfaces.surface import Surface

_ITERATIONS = 40
# Of the lengths of the domain: the longest step, and one that is none.
_MAX_STEP, _SETTLED = 0.1, 1e-13
# Of the surfaces' size: distances that are none.
SAME = 1e-9
# Added to what is inverted, relative to its trace: where surfaces touch it is singular.
_DAMPING = 1e-15


class Meeting:
    """Several surfaces, and all their parameters as one vector.

    Args:
        surfaces: m of class C^1.

    Attributes:
        size: Diagonal of the box around the smallest surface, m.
    """

    def __init__(self, surfaces: Sequence[Surface]) -> None:
        self.surfaces = tuple(surfaces)
        ends = np.array([surface.domain for surface in surfaces]).reshape(-1, 2)
        self.begin, self.end = ends.T
        self.lengths = self.end - self.begin
        self.closed = np.array([surface.closed for surface in surfaces]).ravel()
        self.size = min(_extent(surface) for surface in surfaces)

    def partials(self, theta: np.ndarray, order: int) -> np.ndarray:
        """Partial derivatives of all surfaces.

        Args:
            theta: Parameters within the domains, but for closed directions, shape [n, 2 m].
            order: Highest total order.

        Returns:
            Shape [m, n, partial_count(order), 3].
        """
        parts = [
            surface.partials(self.inside(theta)[:, 2 * k : 2 * k + 2], order)
            for k, surface in enumerate(self.surfaces)
        ]
        return np.array(parts)

    def inside(self, theta: np.ndarray) -> np.ndarray:
        """Parameters moved to the nearest of their domains where these are open, [n, 2 m]."""
        return np.where(self.closed, theta, np.clip(theta, self.begin, self.end))

    def normals(self, theta: np.ndarray) -> np.ndarray:
        """Unit normals of all surfaces, shape [m, n, 3]."""
        partials = self.partials(theta, 1)
        cross = np.cross(partials[:, :, 1], partials[:, :, 2])
        return np.asarray(cross / np.linalg.norm(cross, axis=-1, keepdims=True))

    def gaps(self, theta: np.ndarray) -> np.ndarray:
        """Largest distance of the places on the other surfaces from that on the first, [n], m."""
        places = self.partials(theta, 0)[:, :, 0]
        return np.asarray(np.linalg.norm(places[1:] - places[0], axis=-1).max(axis=0))

    def solve(
        self, theta: np.ndarray, planes: tuple[np.ndarray, np.ndarray] | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Move parameters by the least, in shares of the domains, until the surfaces meet.

        Args:
            theta: Where to begin, shape [n, 2 m].
            planes: Points and normals, [n, 3] each, of planes that the places are to lie in, too;
                with them an edge is met at one place.

        Returns:
            Parameters, [n, 2 m], and whether the surfaces meet there, [n].
        """
        theta = self.inside(theta)
        for _ in range(_ITERATIONS):
            residual, slopes = self._equations(theta, planes)
            square = slopes @ slopes.transpose(0, 2, 1)
            trace = np.trace(square, axis1=1, axis2=2)
            square += _DAMPING * trace[:, None, None] * np.eye(square.shape[1])
            step = slopes.transpose(0, 2, 1) @ np.linalg.solve(square, residual[..., None])
            step = step[..., 0]
            step /= np.maximum(1.0, np.abs(step).max(axis=1, keepdims=True) / _MAX_STEP)
            after = self.inside(theta - step * self.lengths)
            moved = np.abs((after - theta) / self.lengths).max(initial=0.0)
            theta = after
            if moved < _SETTLED:
                break
        return theta, np.linalg.norm(self._equations(theta, planes)[0], axis=1) < SAME * self.size

    def _equations(
        self, theta: np.ndarray, planes: tuple[np.ndarray, np.ndarray] | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Residuals [n, e], m, and their slopes in shares of the domains, [n, e, 2 m]."""
        partials, m = self.partials(theta, 1), len(self.surfaces)
        place, tangents = partials[:, :, 0], partials[:, :, 1:].transpose(0, 1, 3, 2)
        rows = 3 * (m - 1)
        residual = np.zeros((len(theta), rows + (planes is not None)))
        slopes = np.zeros((*residual.shape, 2 * m))
        for k in range(1, m):
            part = slice(3 * k - 3, 3 * k)
            residual[:, part] = place[0] - place[k]
            slopes[:, part, :2], slopes[:, part, 2 * k : 2 * k + 2] = tangents[0], -tangents[k]
        if planes is not None:
            point, normal = planes
            residual[:, -1] = np.einsum("ni,ni->n", normal, place[0] - point)
            slopes[:, -1, :2] = np.einsum("ni,nij->nj", normal, tangents[0])
        return residual, slopes * self.lengths


def _extent(surface: Surface) -> float:
    theta_1, theta_2 = surface.grid(2, 8)
    theta = np.stack(np.meshgrid(theta_1, theta_2), axis=-1).reshape(-1, 2)
    return float(np.linalg.norm(np.ptp(surface.partials(theta, 0)[:, 0], axis=0)))


def numbers(place: np.ndarray) -> str:
    """Return a place for a message, [3], m."""
    rounded = np.round(place, 9) + 0.0
    return "[" + ", ".join(f"{value:.6g}" for value in rounded) + "] m"
