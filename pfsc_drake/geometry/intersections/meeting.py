"""Intersections of surfaces by Newton's method, their tangency, and corners of three."""

import itertools
from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.parametric_surface import Surface
from pfsc_drake.geometry.surfaces.regularity import SampleGrid, sample_grid

_ITERATIONS = 40
# Of the lengths of the domain: the longest step, and a negligible one.
_MAX_STEP, _SETTLED = 0.1, 1e-13
# Of the surfaces' size: negligible distances.
SAME = 1e-9
# Added to the matrix to invert, relative to its trace: where surfaces touch it is singular.
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
        """Return the partial derivatives of all surfaces.

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
        """Return parameters clipped to their domains in open directions, [n, 2 m]."""
        return np.where(self.closed, theta, np.clip(theta, self.begin, self.end))

    def normals(self, theta: np.ndarray) -> np.ndarray:
        """Return the unit normals of all surfaces, shape [m, n, 3]."""
        partials = self.partials(theta, 1)
        cross = np.cross(partials[:, :, 1], partials[:, :, 2])
        return np.asarray(cross / np.linalg.norm(cross, axis=-1, keepdims=True))

    def gaps(self, theta: np.ndarray) -> np.ndarray:
        """Return the largest distance of the first surface's point from the others', [n], m."""
        points = self.partials(theta, 0)[:, :, 0]
        return np.asarray(np.linalg.norm(points[1:] - points[0], axis=-1).max(axis=0))

    def solve(
        self, theta: np.ndarray, planes: tuple[np.ndarray, np.ndarray] | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Move parameters by the least, in shares of the domains, until the surfaces meet.

        Args:
            theta: Initial parameters, shape [n, 2 m].
            planes: Points and normals, [n, 3] each, of planes that contain the points, too; each
                meets an edge at one point.

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
        """Return residuals [n, e], m, and their slopes in shares of the domains, [n, e, 2 m]."""
        partials, m = self.partials(theta, 1), len(self.surfaces)
        sigma, tangents = partials[:, :, 0], partials[:, :, 1:].transpose(0, 1, 3, 2)
        rows = 3 * (m - 1)
        residual = np.zeros((len(theta), rows + (planes is not None)))
        slopes = np.zeros((*residual.shape, 2 * m))
        for k in range(1, m):
            part = slice(3 * k - 3, 3 * k)
            residual[:, part] = sigma[0] - sigma[k]
            slopes[:, part, :2], slopes[:, part, 2 * k : 2 * k + 2] = tangents[0], -tangents[k]
        if planes is not None:
            point, normal = planes
            residual[:, -1] = np.einsum("ni,ni->n", normal, sigma[0] - point)
            slopes[:, -1, :2] = np.einsum("ni,nij->nj", normal, tangents[0])
        return residual, slopes * self.lengths


def _extent(surface: Surface) -> float:
    theta_1, theta_2 = surface.grid(2, 8)
    theta = np.stack(np.meshgrid(theta_1, theta_2), axis=-1).reshape(-1, 2)
    return float(np.linalg.norm(np.ptp(surface.partials(theta, 0)[:, 0], axis=0)))


def numbers(point: np.ndarray) -> str:
    """Return the text of a point, [3], m, for messages."""
    rounded = np.round(point, 9) + 0.0
    return "[" + ", ".join(f"{value:.6g}" for value in rounded) + "] m"


# Radius of the ball around a sample over half of the diagonal to its neighbours: surfaces bend.
_MARGIN = 1.25
# More starts would take long; coincident surfaces have that many.
_MOST_STARTS = 20_000


def starts(surfaces: Sequence[Surface]) -> np.ndarray:
    """Return the parameters of samples between which their surfaces may meet.

    Samples are those of :func:`sample_grid`; a common point of all surfaces lies in the balls
    around one sample of each.

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
    """Return parameters [n, 2 m] without points closer than a distance [m] to an earlier one."""
    points = meeting.partials(theta, 0)[0, :, 0]
    rows: list[int] = []
    for row, point in enumerate(points):
        if not rows or np.linalg.norm(points[rows] - point, axis=1).min() > distance:
            rows.append(row)
    return theta[rows]


def _radii(grid: SampleGrid) -> np.ndarray:
    """Return radii of balls around samples that contain the surface between them, [n_1, n_2]."""
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
    """Return for each ball around the points of one the balls of another that it meets."""
    found = cKDTree(other).query_ball_point(one, r + s.max())
    return [
        [j for j in near if np.linalg.norm(one[i] - other[j]) <= r[i] + s[j]] if near else []
        for i, near in enumerate(found)
    ]


def _touch(points: list[np.ndarray], radii: list[np.ndarray], group: tuple[int, ...]) -> bool:
    """Return whether the balls of the second and the third surface meet, too."""
    j, k = group
    return bool(np.linalg.norm(points[1][j] - points[2][k]) <= radii[1][j] + radii[2][k])


def _apart(points: list[np.ndarray]) -> str:
    far = np.max([cKDTree(other).query(points[0])[0] for other in points[1:]], axis=0)
    return (
        f"surfaces: do not meet within their bounds, {far.min():.3g} m between their nearest "
        "samples; larger or other ones are required"
    )


# Sine of the angle between normals below which surfaces touch: points of tangency are only found
# roughly.
_TOUCHING = 1e-3
# Difference of curvatures times the size, below which surfaces that touch are one.
_ONE = 1e-4


def require_crossing(meeting: Meeting, theta: np.ndarray) -> None:
    """Refuse points at which two surfaces have one tangent plane.

    Args:
        meeting: Two surfaces of class C^2.
        theta: Parameters of common points, [n, 4].

    Raises:
        InputError: They touch or coincide there; says which and where.
    """
    first, second = meeting.normals(theta)
    sine = np.linalg.norm(np.cross(first, second), axis=1)
    row = int(np.argmin(sine))
    if sine[row] > _TOUCHING:
        return
    where = numbers(meeting.partials(theta[row : row + 1], 0)[0, 0, 0])
    same_side = float(np.sign(first[row] @ second[row]))
    bends = [_bending(meeting, k, theta[row]) for k in (0, 1)]
    if np.abs(bends[0] - same_side * bends[1]).max() * meeting.size < _ONE:
        raise InputError(
            f"surfaces: coincide around {where}; two that cross each other are required"
        )
    raise InputError(
        f"surfaces: touch at {where} instead of crossing each other; an edge is where their "
        "normals differ"
    )


def _bending(meeting: Meeting, k: int, theta: np.ndarray) -> np.ndarray:
    """Return the second fundamental form of surface k in the directions of space, [3, 3], 1/m."""
    partials = meeting.partials(theta[None], 2)[k, 0]
    normal = np.cross(partials[1], partials[2])
    normal /= np.linalg.norm(normal)
    second = np.array([[partials[3] @ normal, partials[4] @ normal]] * 2)
    second[1] = partials[4] @ normal, partials[5] @ normal
    dual = np.linalg.pinv(partials[1:3])
    return np.asarray(dual @ second @ dual.T)


# Volume that three unit normals span, below which they lie in a plane.
_FLAT = 1e-3
# Of the size: corners that are nearer to each other are one.
_ONE_CORNER = 1e-6


def find_corners(first: Surface, second: Surface, third: Surface) -> np.ndarray:
    """Return all points at which three surfaces meet.

    Corners closer than the samples of :func:`sample_grid` may be overlooked.

    Args:
        first: Surface of class C^1.
        second: Another.
        third: Another.

    Returns:
        Points [corners, 3], m, one or more, by x, then y, then z.

    Raises:
        InputError: They meet nowhere within their bounds, or somewhere with normals that lie in a
            plane, as where an edge of two touches the third; says where.
    """
    meeting = Meeting([first, second, third])
    theta, good = meeting.solve(starts(meeting.surfaces))
    if not good.any():
        raise InputError(
            "surfaces: all three do not meet within their bounds, though they come as near as "
            f"{meeting.gaps(theta).min():.3g} m; larger or other ones are required"
        )
    theta = theta[good]
    volume = np.abs(np.linalg.det(meeting.normals(theta).transpose(1, 0, 2)))
    row = int(np.argmin(volume))
    if volume[row] < _FLAT:
        where = numbers(meeting.partials(theta[row : row + 1], 0)[0, 0, 0])
        raise InputError(
            f"surfaces: an edge of two touches the third at {where}; a corner is where three "
            "normals do not lie in a plane"
        )
    one = _ONE_CORNER * meeting.size
    points = meeting.partials(distinct(meeting, theta, one), 0)[0, :, 0]
    return points[np.lexsort(np.round(points / one).T[::-1])]
