"""Simple surfaces over which a workpiece is a function of two parameters."""

import math
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull, QhullError

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.spline import UniformKnots
from pfsc_drake.geometry.surfaces.parametric_surface import rotation_from_axes

# Sites per knot interval at which a circle is fitted by a spline.
_SITES = 3
# Angle without points, in spacings, above which a patch is not closed.
_OPEN_GAP = 4.0


class Base(Protocol):
    """Parameters and heights of points over a simple surface.

    Attributes:
        name: Name for messages.
        closed: Whether each direction is periodic.
        period: Period of theta_1 if it is periodic, m.
    """

    name: str
    closed: tuple[bool, bool]
    period: float

    def parameters(self, points: np.ndarray) -> np.ndarray:
        """Return parameters of points [n, 3] projected onto the base, lengths in m, [n, 2]."""

    def heights(self, points: np.ndarray) -> np.ndarray:
        """Return distances of points [n, 3] from the base along its normals, m, [n]."""

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return unit normals of the base at projected points, on the desired side, [n, 3]."""

    def coefficients(
        self, first: UniformKnots, second: UniformKnots, heights: np.ndarray
    ) -> np.ndarray:
        """Return spline coefficients of a surface in space from the coefficients of its heights.

        Args:
            first: Knots of theta_1.
            second: Knots of theta_2.
            heights: [first.count, second.count], m.

        Returns:
            [first.count, second.count, 3], m; normals (4.3) are on the side of `normals`.
        """


class PlaneBase:
    """A plane; theta are lengths along two sides of the narrowest rectangle around all points.

    Args:
        points: [n, 3], m, not along one line.
        normal: Normal of the plane, on the desired side, of any length, [3].
        along: Direction that theta_1 leans to; by default the longer side.

    Raises:
        InputError: The points lie on one line, or `along` is the normal.
    """

    name = "a plane"
    closed = (False, False)
    period = 0.0

    def __init__(
        self, points: np.ndarray, normal: np.ndarray, along: ArrayLike | None = None
    ) -> None:
        self._origin = points.mean(axis=0)
        if along is None:
            along = _longer_side(points - self._origin, normal)
        self._axes = rotation_from_axes(normal, along)

    def parameters(self, points: np.ndarray) -> np.ndarray:
        """Return parameters of points [n, 3] projected onto the base, lengths in m, [n, 2]."""
        return np.asarray((points - self._origin) @ self._axes[:, :2])

    def heights(self, points: np.ndarray) -> np.ndarray:
        """Return distances of points [n, 3] from the base along its normals, m, [n]."""
        return np.asarray((points - self._origin) @ self._axes[:, 2])

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return unit normals of the base at projected points, on the desired side, [n, 3]."""
        return np.broadcast_to(self._axes[:, 2], points.shape)

    def coefficients(
        self, first: UniformKnots, second: UniformKnots, heights: np.ndarray
    ) -> np.ndarray:
        """Return spline coefficients of a surface in space from the coefficients of its heights."""
        e_1, e_2, normal = self._axes.T
        along = first.linear[:, None, None] * e_1 + second.linear[None, :, None] * e_2
        return np.asarray(self._origin + along + heights[:, :, None] * normal)


class CylinderBase:
    """A cylinder; theta_1 is the arc length about its axis, theta_2 the height along it.

    Args:
        points: [n, 3], m; the radius is the mean of their distances from the axis.
        origin: A point on the axis, [3], m.
        axis: Its direction, of any length, [3].
        spacing: Spacing of the points, m: the patch is closed if there is no wider gap around the
            axis.
        outward: Whether normals point away from the axis.

    Raises:
        InputError: Points on the axis.
    """

    name = "a cylinder"

    def __init__(
        self,
        points: np.ndarray,
        origin: np.ndarray,
        axis: np.ndarray,
        spacing: float,
        *,
        outward: bool = True,
    ) -> None:
        self._origin = np.asarray(origin, dtype=float)
        guess = np.eye(3)[int(np.argmin(np.abs(axis)))]
        # mirrored axes invert the sense of x and y, and the normal
        self._side = 1.0 if outward else -1.0
        self._axes = rotation_from_axes(axis, guess) * [1.0, self._side, 1.0]
        x, y, _ = ((points - self._origin) @ self._axes).T
        self.radius = float(np.hypot(x, y).mean())
        if not np.hypot(x, y).min() > 1e-3 * self.radius:
            raise InputError(
                "surface points: some lie on the axis of the cylinder they are projected on"
            )
        angles = np.sort(np.arctan2(y, x))
        gaps = np.diff(angles, append=angles[0] + 2.0 * math.pi)
        widest = int(np.argmax(gaps))
        closed = bool(gaps[widest] * self.radius < _OPEN_GAP * spacing)
        self._start = 0.0 if closed else float(angles[widest] + 0.5 * gaps[widest])
        self.closed = (closed, False)
        self.period = 2.0 * math.pi * self.radius

    def parameters(self, points: np.ndarray) -> np.ndarray:
        """Return parameters of points [n, 3] projected onto the base, lengths in m, [n, 2]."""
        x, y, z = self._local(points)
        turn = np.mod(np.arctan2(y, x) - self._start, 2.0 * math.pi)
        return np.stack([self.radius * turn, z], axis=1)

    def heights(self, points: np.ndarray) -> np.ndarray:
        """Return distances of points [n, 3] from the base along its normals, m, [n]."""
        x, y, _ = self._local(points)
        return np.asarray(self._side * (np.hypot(x, y) - self.radius))

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Return unit normals of the base at projected points, on the desired side, [n, 3]."""
        x, y, _ = self._local(points)
        radial = np.stack([x, y], axis=1) / np.hypot(x, y)[:, None]
        return np.asarray(self._side * radial @ self._axes[:, :2].T)

    def coefficients(
        self, first: UniformKnots, second: UniformKnots, heights: np.ndarray
    ) -> np.ndarray:
        """Return the spline coefficients of a surface in space from those of its heights.

        A circle is no polynomial, and approximated with an error of about step^7.
        """
        sites = first.begin + first.step / _SITES * (np.arange(_SITES * first.intervals) + 0.5)
        basis = first.basis(sites).toarray()
        radii = self.radius + self._side * (basis @ heights)
        angles = self._start + sites / self.radius
        flat = [np.linalg.lstsq(basis, f(angles)[:, None] * radii)[0] for f in (np.cos, np.sin)]
        axial = np.broadcast_to(second.linear, heights.shape)
        return np.asarray(self._origin + np.stack([*flat, axial], axis=-1) @ self._axes.T)

    def _local(self, points: np.ndarray) -> np.ndarray:
        """Return coordinates along the axes, [3, n], m."""
        return np.asarray(((points - self._origin) @ self._axes).T)


def axis_of_normals(points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the line nearest to all normals: a point on it and its direction, [3] each.

    Args:
        points: [n, 3], m.
        normals: Unit normals of any sign, [n, 3].
    """
    axis = np.linalg.eigh(normals.T @ normals)[1][:, 0]
    tangents = np.cross(axis, normals)
    offsets = np.sum(tangents * (points - points.mean(axis=0)), axis=1)
    origin = np.linalg.lstsq(tangents, offsets, rcond=1e-6)[0]
    return points.mean(axis=0) + origin, axis


def _longer_side(points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return the direction of the longer side of the narrowest rectangle around points, [3]."""
    guess = np.eye(3)[int(np.argmin(np.abs(normal)))]
    axes = rotation_from_axes(normal, guess)[:, :2]
    flat = points @ axes
    try:
        corners = flat[ConvexHull(flat).vertices]
    except QhullError:
        raise InputError(
            "surface points: all lie along one line; points of a surface are required"
        ) from None
    sides = np.roll(corners, -1, axis=0) - corners
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    across = np.stack([-sides[:, 1], sides[:, 0]], axis=1)
    extents = np.ptp(corners @ np.stack([sides, across]).transpose(0, 2, 1), axis=1)
    best = int(np.argmin(extents[0] * extents[1]))
    side = sides[best] if extents[0, best] >= extents[1, best] else across[best]
    direction = axes @ side
    # of both senses that which points to larger coordinates
    return np.asarray(direction * np.sign(direction[int(np.argmax(np.abs(direction)))]))
