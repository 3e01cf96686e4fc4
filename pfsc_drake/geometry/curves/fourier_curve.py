"""Closed curves given by a Fourier series."""

import math

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve, check_order

# Between the axes of a circle: smaller angles do not define its plane accurately.
_LEAST_ANGLE_DEG = 0.1


class FourierCurve(Curve):
    """sigma(theta) = c + sum_k a_k cos(k theta) + b_k sin(k theta), k = 1..harmonics.

    Analytic and closed with the period 2 pi.

    Args:
        constant: c, shape [dimension].
        cosine: a_k, shape [harmonics, dimension].
        sine: b_k, shape [harmonics, dimension].

    Raises:
        InputError: the shapes do not fit or a value is not finite.
    """

    def __init__(self, constant: ArrayLike, cosine: ArrayLike, sine: ArrayLike) -> None:
        c = np.array(constant, dtype=float)
        a = np.array(cosine, dtype=float)
        b = np.array(sine, dtype=float)
        if c.ndim != 1 or a.ndim != 2 or a.shape != b.shape or a.shape[1:] != c.shape or not a.size:
            raise InputError(
                f"Fourier coefficients: shapes {c.shape}, {a.shape}, {b.shape};"
                " [dimension], [harmonics, dimension], [harmonics, dimension] are required"
            )
        if not all(np.all(np.isfinite(values)) for values in (c, a, b)):
            raise InputError("Fourier coefficients: not finite; finite values are required")
        super().__init__(len(c), [0.0, 2.0 * math.pi], closed=True, smoothness=math.inf)
        self.constant, self.cosine, self.sine = c, a, b

    @classmethod
    def circle(
        cls,
        center: ArrayLike,
        radius: float,
        axis_u: ArrayLike = (1.0, 0.0, 0.0),
        axis_v: ArrayLike = (0.0, 1.0, 0.0),
    ) -> "FourierCurve":
        """Return the circle center + radius (u cos(theta) + v sin(theta)).

        Args:
            center: Centre [dimension], m.
            radius: Radius, m, positive.
            axis_u: Direction u of the point theta = 0, [dimension]; made a unit vector.
            axis_v: Direction in the plane of the circle, [dimension]; its part
                perpendicular to u, made a unit vector, is v.

        Returns:
            The closed curve.

        Raises:
            InputError: radius not positive, u or v zero, or less than 0.1 deg between them.
        """
        if not (0.0 < radius < math.inf):
            raise InputError(f"circle radius: {radius}; a positive number of metres is required")
        u, v = _direction("u", axis_u), _direction("v", axis_v)
        v = v - (u @ v) * u
        # Of two unit vectors: the sine of the angle between them, or between their lines.
        angle = math.degrees(math.asin(min(1.0, float(np.linalg.norm(v)))))
        if angle < _LEAST_ANGLE_DEG:
            axes = f"u = {np.asarray(axis_u).tolist()}, v = {np.asarray(axis_v).tolist()}"
            raise InputError(
                f"circle axes: {axes}, {angle:.2g} deg between them; at least"
                f" {_LEAST_ANGLE_DEG:g} deg is required"
            )
        v /= np.linalg.norm(v)
        return cls(center, [radius * u], [radius * v])

    @classmethod
    def bent_lemniscate(
        cls,
        center: ArrayLike = (0.7, 0.2, 1.103),
        width: float = 0.25,
        height: float = 0.1,
    ) -> "FourierCurve":
        """Return the vertically bent lemniscate (3.87).

        center + [width cos(theta), width sin(theta) cos(theta), height sin(theta)^2];
        it crosses itself at theta = pi/2 and 3 pi/2.

        Args:
            center: Offset [3], m.
            width: Half of the extent in x, m.
            height: Height of the bend, m.

        Returns:
            The closed curve.
        """
        constant = np.add(center, (0.0, 0.0, height / 2.0))
        cosine = [[width, 0.0, 0.0], [0.0, 0.0, -height / 2.0]]
        sine = [[0.0, 0.0, 0.0], [0.0, width / 2.0, 0.0]]
        return cls(constant, cosine, sine)

    def derivatives(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Return derivatives 0..order with respect to theta, for set-up and figures."""
        angles = self._to_domain(theta)[..., None] * np.arange(1, len(self.cosine) + 1)
        basis = np.empty((*angles.shape[:-1], 2 * len(self.cosine) + 1))
        basis[..., 0] = 1.0
        basis[..., 1::2] = np.cos(angles)
        basis[..., 2::2] = np.sin(angles)
        return np.einsum("kdj,...j->...kd", self._table(order), basis)

    def _table(self, order: int) -> np.ndarray:
        """Return a map from [1, cos, sin, ...] to derivatives, [order + 1, dimension, terms]."""
        table = np.zeros((check_order(order) + 1, self.dimension, 2 * len(self.cosine) + 1))
        table[0, :, 0] = self.constant
        a, b = self.cosine, self.sine
        k = np.arange(1, len(a) + 1)[:, None]
        for row in table:
            row[:, 1::2], row[:, 2::2] = a.T, b.T
            a, b = k * b, -k * a
        return table


def _direction(name: str, axis: ArrayLike) -> np.ndarray:
    """Return the unit vector of a vector of any length; refuse zero or NaN."""
    vector = np.array(axis, dtype=float)
    largest = float(np.abs(vector).max(initial=0.0))
    if not 0.0 < largest < math.inf:
        raise InputError(
            f"circle axes: {name} = {vector.tolist()}; a finite vector that is not zero is required"
        )
    # First by the largest component: squares of large numbers overflow.
    vector = vector / largest
    return np.asarray(vector / np.linalg.norm(vector))
