"""Reference orientation along a path."""

import math

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.curves.spline import check_parameters, check_smoothness, interpolate_at
from pfsc_drake.geometry.rotation import quaternion_to_matrix

_MAX_NEIGHBOUR_ANGLE = math.radians(170.0)
_MIN_NORM = 0.1
_SAMPLES_PER_SEGMENT = 64
_SAME_ROTATION = 1e-6


class OrientationCurve(Curve):
    """Orientation sigma_r(theta) as a curve of quaternions that need not have length one.

    ``R(theta) = H(q(theta)) / |q(theta)|^2`` with H homogeneous of degree two is as smooth as
    q and free of representation singularities, unlike the Euler angles of section 3.1.
    The period of a closed one may be two revolutions of the path: the quaternions of the
    two then differ in sign, the orientations do not.

    Args:
        curve: Quaternions (w, x, y, z), a curve of dimension 4.

    Raises:
        InputError: dimension other than 4, or ``|q| <= 0.1`` somewhere.
    """

    def __init__(self, curve: Curve) -> None:
        if curve.dimension != 4:
            raise InputError(f"orientation curve: dimension {curve.dimension}; 4 is required")
        super().__init__(4, curve.breakpoints, closed=curve.closed, smoothness=curve.smoothness)
        self._curve = curve
        theta = np.unique(
            np.linspace(self.breakpoints[:-1], self.breakpoints[1:], _SAMPLES_PER_SEGMENT)
        )
        values = curve.derivatives(theta, 0)[:, 0]
        norm = np.linalg.norm(values, axis=1)
        lowest = int(np.argmin(norm))
        if not norm[lowest] > _MIN_NORM:
            raise InputError(
                f"orientation: |q| = {norm[lowest]:.3g} at theta = {theta[lowest]:.6g}; more than"
                f" {_MIN_NORM} is required (use more keyframes there)"
            )
        self.constant = bool(np.all(values == values[0]))

    @classmethod
    def fixed(cls, quaternion: ArrayLike, domain: tuple[float, float]) -> "OrientationCurve":
        """Return a constant orientation.

        Args:
            quaternion: (w, x, y, z), [4], not zero.
            domain: First and last parameter of the path it belongs to.

        Returns:
            The constant curve; it fits open and closed paths.
        """
        q = _normalize(np.atleast_2d(np.asarray(quaternion, dtype=float)))
        return cls(PiecewisePolynomialCurve(domain, q[None], closed=True))

    def first_discontinuity(self, order: int) -> float | None:
        """Return the parameter at which a derivative of at most this order first jumps."""
        return self._curve.first_discontinuity(order)

    def derivatives(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Return derivatives 0..order of the quaternion with respect to theta."""
        return self._curve.derivatives(theta, order)

    def rotation_matrix(self, theta: ArrayLike) -> np.ndarray:
        """Return the rotation matrices R(theta).

        Args:
            theta: Path parameters, shape [...].

        Returns:
            Array [..., 3, 3].
        """
        return quaternion_to_matrix(self.derivatives(theta, 0)[..., 0, :])


def interpolate_orientation(
    quaternions: ArrayLike,
    parameters: ArrayLike,
    *,
    smoothness: int,
    closed: bool = False,
) -> OrientationCurve:
    """Return a smooth orientation through keyframes.

    Args:
        quaternions: Keyframes (w, x, y, z), [n, 4], of any length but zero and any sign.
            With one keyframe the orientation is constant.
        parameters: theta of the keyframes, strictly increasing, [n]; [n + 1] with the end
            of the period last if `closed` and the first keyframe is not repeated. With
            one keyframe: the two ends of the domain.
        smoothness: k of the class C^k, 2..6. Few keyframes of an open curve are joined by
            one polynomial, which has all derivatives.
        closed: True if the orientation is periodic.

    Returns:
        The curve. Its period is two revolutions if the quaternion returns with its sign flipped.

    Raises:
        InputError: values not finite or zero, neighbours more than 170 degrees apart, a
            closed curve whose last keyframe is not the first, or ``|q| <= 0.1`` in between.
    """
    q = _normalize(np.array(quaternions, dtype=float))
    check_smoothness(smoothness)
    if len(q) == 1:
        begin, end = check_parameters(parameters, 2).tolist()
        return OrientationCurve.fixed(q[0], (begin, end))
    if closed and np.size(parameters) == len(q) + 1:
        q = np.vstack([q, q[0]])
    theta = check_parameters(parameters, len(q))
    q = check_neighbours(q)
    degree = smoothness + 1
    if not closed:
        degree = min(degree, len(q) - 1)
        return OrientationCurve(interpolate_at(theta, q, degree, closed=False))
    mismatch = min(float(np.abs(q[-1] - q[0]).max()), float(np.abs(q[-1] + q[0]).max()))
    if mismatch > _SAME_ROTATION:
        raise InputError(
            f"orientation: last keyframe {q[-1].tolist()} of a closed curve differs from"
            f" the first {q[0].tolist()}; they must be the same rotation"
        )
    if len(q) < 4:
        raise InputError(
            f"orientation: {len(q) - 1} distinct keyframes for a closed curve;"
            " one, or at least 3, are needed"
        )
    if q[-1] @ q[0] < 0.0:
        theta = np.concatenate([theta, theta[1:] + (theta[-1] - theta[0])])
        q = np.vstack([q[:-1], -q])
        q[-1] = q[0]
    return OrientationCurve(interpolate_at(theta, q, degree, closed=True))


def check_neighbours(quaternions: np.ndarray) -> np.ndarray:
    """Return quaternions with signs such that neighbours are close.

    Args:
        quaternions: (w, x, y, z), [n, 4], of length one.

    Returns:
        The same orientations, [n, 4].

    Raises:
        InputError: neighbours are more than 170 degrees apart.
    """
    cosines = np.sum(quaternions[1:] * quaternions[:-1], axis=1)
    angles = 2.0 * np.arccos(np.minimum(1.0, np.abs(cosines)))
    far = np.flatnonzero(angles > _MAX_NEIGHBOUR_ANGLE)
    if far.size:
        row = int(far[0])
        raise InputError(
            f"orientations {row + 1} and {row + 2} are"
            f" {math.degrees(angles[row]):.1f} deg apart; at most"
            f" {math.degrees(_MAX_NEIGHBOUR_ANGLE):.0f} deg is allowed"
        )
    signs = np.cumprod(np.where(cosines < 0.0, -1.0, 1.0))
    return quaternions * np.concatenate([[1.0], signs])[:, None]


def _normalize(q: np.ndarray) -> np.ndarray:
    """Return unit quaternions [n, 4]; refuse zero and NaN."""
    if q.ndim != 2 or q.shape[1:] != (4,) or len(q) == 0:
        raise InputError(f"quaternions: shape {q.shape}; [n, 4] is required")
    norm = np.linalg.norm(q, axis=1)
    bad = ~((norm > 1e-9) & np.isfinite(norm))
    if np.any(bad):
        row = int(np.argmax(bad))
        raise InputError(
            f"quaternion {row + 1}: {q[row].tolist()}; finite values, not all zero, are required"
        )
    return q / norm[:, None]
