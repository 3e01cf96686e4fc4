"""Where a region stands in the world."""

import math

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.surfaces.placement import rotation_from_axes

Triple = tuple[float, float, float]


def checked_point(name: str, values: ArrayLike) -> Triple:
    """Return three finite numbers as floats.

    Raises:
        InputError: They are none.
    """
    v = np.asarray(values, dtype=float)
    if v.shape != (3,) or not np.all(np.isfinite(v)):
        raise InputError(f"region {name}: {v.tolist()}; 3 finite numbers, in m, are required")
    x, y, z = v.tolist()
    return x, y, z


def checked_length(name: str, value: float) -> float:
    """Return a positive finite number as a float.

    Raises:
        InputError: It is none.
    """
    if not 0.0 < value < math.inf:
        raise InputError(f"region {name}: {value} m; a positive number of metres is required")
    return float(value)


def axes_along(axis: ArrayLike) -> np.ndarray:
    """Unit vectors, the third along an axis, by rows, [3, 3].

    Args:
        axis: Of any length, [3].

    Raises:
        InputError: No direction.
    """
    v = np.asarray(axis, dtype=float)
    leaning = np.eye(3)[int(np.argmin(np.abs(v)))] if v.shape == (3,) else v
    return rotation_from_axes(v, leaning).T
