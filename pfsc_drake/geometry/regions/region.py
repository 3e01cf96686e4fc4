"""Admissible regions: their common interface."""

import math
from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.compiled.bound_function import PlainFunction
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.parametric_surface import rotation_from_axes

Triple = tuple[float, float, float]


def checked_point(name: str, values: ArrayLike) -> Triple:
    """Return three finite numbers as floats.

    Raises:
        InputError: They are not three finite numbers.
    """
    v = np.asarray(values, dtype=float)
    if v.shape != (3,) or not np.all(np.isfinite(v)):
        raise InputError(f"region {name}: {v.tolist()}; 3 finite numbers, in m, are required")
    x, y, z = v.tolist()
    return x, y, z


def checked_length(name: str, value: float) -> float:
    """Return a positive finite number as a float.

    Raises:
        InputError: It is not positive and finite.
    """
    if not 0.0 < value < math.inf:
        raise InputError(f"region {name}: {value} m; a positive number of metres is required")
    return float(value)


def axes_along(axis: ArrayLike) -> np.ndarray:
    """Return the unit vectors, the third along an axis, by rows, [3, 3].

    Args:
        axis: Vector along the axis, of any length, [3].

    Raises:
        InputError: No direction.
    """
    v = np.asarray(axis, dtype=float)
    leaning = np.eye(3)[int(np.argmin(np.abs(v)))] if v.shape == (3,) else v
    return rotation_from_axes(v, leaning).T


Distance = tuple[float, ...]
# ca.SX or ca.MX, which have no types
Symbol = Any


class Region(ABC):
    """Fixed part of space whose boundary a tool must not cross (Sec. 5.1.1).

    The distance is to the closest point of the whole boundary, not to one near a guess. It is
    therefore 1-Lipschitz: after a motion by dz the tool is not nearer than ``h - |dz|``.
    """

    @abstractmethod
    def distance(self, x: float, y: float, z: float) -> Distance:
        """Return the signed distance to the boundary, positive in the admissible region.

        Args:
            x: Coordinate x of the tool point, world axes, finite, m.
            y: Coordinate y, likewise.
            z: Coordinate z, likewise.

        Returns:
            h, m, and its gradient, the unit normal n at the closest point into the admissible
            region, as plain floats. Where several points of the boundary are equally near, the
            gradient belongs to one of them, always the same.
        """

    @property
    @abstractmethod
    def signed_distance(self) -> ca.Function:
        """Signed distance of symbols or numbers, a function ``(point) -> (h, n)``.

        For a NaN or infinite point h is NaN.

        Raises:
            InputError: The distance is no expression; says why.
        """


class FormulaRegion(Region):
    """Region whose distance is an expression.

    Attributes:
        symbol: Type of its symbols: scalars, or matrices for table look-ups.
    """

    symbol: Any = ca.SX

    @abstractmethod
    def formula(self, point: Symbol) -> tuple[Symbol, Symbol]:
        """Return the signed distance and normal as expressions.

        Args:
            point: The tool point, world axes, [3], m.

        Returns:
            h, m, and n, [3], see :meth:`Region.distance`.
        """

    @cached_property
    def signed_distance(self) -> ca.Function:
        """Signed distance of symbols or numbers, a function ``(point) -> (h, n)``."""
        point = self.symbol.sym("point", 3)
        h, n = self.formula(point)
        is_finite = ca.dot(point, point) < math.inf
        return ca.Function(
            "signed_distance",
            [point],
            [ca.if_else(is_finite, h, math.nan), n],
            ["point"],
            ["h", "n"],
        )

    @cached_property
    def _distance(self) -> PlainFunction:
        return PlainFunction(self.signed_distance)

    def distance(self, x: float, y: float, z: float) -> Distance:
        """Return the signed distance to the boundary, positive in the admissible region."""
        return self._distance(x, y, z)


def direction(vector: Symbol, otherwise: tuple[float, ...]) -> tuple[Symbol, Symbol]:
    """Return the length and unit vector of a vector.

    Args:
        vector: [n].
        otherwise: The unit vector of one without length, [n].
    """
    length = ca.norm_2(vector)
    some = length > 0.0
    return length, ca.if_else(some, vector / ca.if_else(some, length, 1.0), ca.DM(otherwise))
