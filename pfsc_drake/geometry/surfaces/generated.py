"""Surfaces made by moving a profile curve: turned about an axis, or along another curve."""

import math

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve
from pfsc_drake.geometry.surfaces.basis import TrigonometricBasis, curve_on_basis
from pfsc_drake.geometry.surfaces.parametric_surface import checked_placement
from pfsc_drake.geometry.surfaces.product import ProductSurface
from pfsc_drake.geometry.surfaces.regularity import check_regular

_TURN = 2.0 * math.pi


def surface_of_revolution(
    profile: Curve,
    *,
    part: tuple[float, float] | None = None,
    origin: ArrayLike = (0.0, 0.0, 0.0),
    rotation: ArrayLike | None = None,
    angles: tuple[float, float] | None = None,
    inward: bool = False,
) -> ProductSurface:
    """Surface that a profile leaves when it is turned about an axis.

    sigma = o + rho(theta_2) (e_x cos(theta_1) + e_y sin(theta_1)) + h(theta_2) e_z, with the
    columns e of the rotation. Where h grows with theta_2 the normal (4.3) points away from the
    axis.

    Args:
        profile: (rho, h), a curve in the plane, m.
        part: Parameters of the profile that are used, of a Fourier curve; all by default.
        origin: o, [3], m.
        rotation: [3, 3]; the identity by default.
        angles: First and last theta_1, rad; closed by default.
        inward: Turn the other way, -e_y instead of e_y, and with it the normal round.

    Raises:
        InputError: A profile of another dimension, one that meets the axis or is not
            regular, or angles that do not increase or exceed a turn.
    """
    if profile.dimension != 2:
        raise InputError(f"profile: dimension {profile.dimension}; (radius, height) is required")
    begin, end = angles or (0.0, _TURN)
    if not 0.0 < end - begin <= _TURN * (1.0 + 1e-12):
        raise InputError(
            f"angles: [{begin:.9g}, {end:.9g}] rad; must increase, by at most {_TURN:.9g}"
        )
    o, R = checked_placement(origin, rotation)
    second, table = curve_on_basis(profile, part)
    coefficients = np.zeros((1, len(table), 3, second.size, 3))
    rho, height = table[..., 0, None], table[..., 1, None]
    coefficients[0, :, 0] = height * R[:, 2]
    coefficients[0, :, 0, 0] += o
    coefficients[0, :, 1] = rho * R[:, 0]
    coefficients[0, :, 2] = rho * (-R[:, 1] if inward else R[:, 1])
    first = TrigonometricBasis((begin, end), 1, closed=angles is None)
    surface = ProductSurface(first, second, coefficients, smoothness=profile.smoothness)
    check_regular(surface)
    return surface


def translated_surface(profile: Curve, rail: Curve) -> ProductSurface:
    """Surface that a profile leaves when it is moved along a rail without turning.

    sigma = profile(theta_1) + rail(theta_2).

    Args:
        profile: Curve in R^3, m.
        rail: Curve in R^3, m.

    Raises:
        InputError: A curve of another dimension, or a surface that is not regular.
    """
    for name, curve in (("profile", profile), ("rail", rail)):
        if curve.dimension != 3:
            raise InputError(f"{name}: dimension {curve.dimension}; 3 is required")
    first, moved = curve_on_basis(profile)
    second, moving = curve_on_basis(rail)
    coefficients = np.zeros((len(moved), len(moving), first.size, second.size, 3))
    coefficients[:, :, :, 0] += moved[:, None]
    coefficients[:, :, 0] += moving
    smoothness = min(profile.smoothness, rail.smoothness)
    surface = ProductSurface(first, second, coefficients, smoothness=smoothness)
    check_regular(surface)
    return surface


def extruded_surface(profile: Curve, direction: ArrayLike, length: float) -> ProductSurface:
    """Surface that a profile leaves when it is moved along a line; theta_2 is the way, m.

    Args:
        profile: Curve in R^3, m.
        direction: Direction of the motion, of any length, [3].
        length: Length of the motion, m, positive.

    Raises:
        InputError: No direction or length, or one along the profile.
    """
    d = np.asarray(direction, dtype=float)
    norm = float(np.linalg.norm(d))
    if d.shape != (3,) or not 0.0 < norm < math.inf or not 0.0 < length < math.inf:
        raise InputError(
            f"extrusion: direction {d.tolist()}, length {length}; three finite numbers, not all"
            " zero, and a positive number of metres are required"
        )
    return translated_surface(
        profile, PiecewisePolynomialCurve.line(np.zeros(3), d * (length / norm))
    )
