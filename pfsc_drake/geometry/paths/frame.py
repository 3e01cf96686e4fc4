"""Parallel transport frame along a curve, and one that is turned on a closed lap."""

import math
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.piecewise_fit import chebyshev_nodes, power_coefficients
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve

# The dense output of the method is a polynomial of degree 7 on each of its steps.
_DENSE_DEGREE = 7
_RELATIVE, _ABSOLUTE = 1e-13, 1e-14
_VERTICAL = 0.9

Vector = tuple[float, float, float]


class ParallelTransportFrame:
    """Orthonormal frame (e_par, e_perp, e_cross) that does not turn about the tangent.

    e_par = sigma'/|sigma'| (3.1); e_perp solves (3.4), e_perp' = -(e_par' . e_perp) e_par,
    from the begin of the domain; e_cross = e_par x e_perp (3.5). Defined where the curvature
    is zero. The equation is solved once, so the frame is a function of theta alone: unlike
    the iteration (3.81) it needs no memory and does not depend on the speed.

    On a closed curve the frame comes back turned about e_par by the holonomy angle;
    e_perp then also depends on the lap, which is taken from the unwrapped theta.

    Args:
        curve: Regular curve in R^3, at least of class C^1.
        initial_normal: e_perp at the begin of the domain, [3]: made perpendicular to the
            tangent and a unit vector. The default is the direction closest to the world's
            z, or x where the tangent is within 26 degrees of z.

    Attributes:
        turns: False: it does not turn about the tangent.
        holonomy: Angle from e_perp(theta) to e_perp(theta + period) about e_par, rad, in
            (-pi, pi]; zero for an open curve.
        breakpoints: Between two of them e_perp is smooth, with those of the curve, [n].

    Raises:
        InputError: the curve is not three-dimensional or has a corner, or the initial
            normal is parallel to the tangent.
    """

    turns = False

    def __init__(self, curve: Curve, initial_normal: ArrayLike | None = None) -> None:
        if curve.dimension != 3:
            raise InputError(f"frame: curve of dimension {curve.dimension}; 3 is required")
        corner = curve.first_discontinuity(1)
        if corner is not None:
            raise InputError(
                f"frame: tangent jumps at theta = {corner:.9g}; class C^1 or better is required"
            )
        self._curve = curve
        start = _unit(curve.derivatives(curve.domain[0], 1)[1])
        normal = _initial_normal(start, initial_normal)
        breaks, table, last = _transport(curve, normal)
        self.holonomy = 0.0
        if curve.closed:
            self.holonomy = math.atan2(last @ np.cross(start, normal), last @ normal)
        self._table = PiecewisePolynomialCurve(breaks, table, known_smoothness=1)
        self.breakpoints = self._table.breakpoints

    def normals(self, theta: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Both normal vectors.

        Args:
            theta: Unwrapped path parameters, shape [...].

        Returns:
            e_perp and e_cross, each [..., 3]: exactly perpendicular to the curve's tangent and
            to each other, of length one.

        Raises:
            InputError: theta lies outside the domain of an open curve.
        """
        values = np.asarray(theta, dtype=float)
        tangents = _unit(self._curve.derivatives(values, 1)[..., 1, :])
        laps = self._curve.laps(values)
        local = np.clip(values - laps * self._curve.period, *self._curve.domain)
        e_perp = self._table.derivatives(local, 0)[..., 0, :]
        along = np.sum(e_perp * tangents, axis=-1, keepdims=True)
        e_perp = _unit(e_perp - along * tangents)
        e_cross = np.cross(tangents, e_perp)
        turn = (laps * self.holonomy)[..., None]
        c, s = np.cos(turn), np.sin(turn)
        return c * e_perp + s * e_cross, c * e_cross - s * e_perp

    def turning(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Derivatives 1..order of the angle by which it turns, all zero, [..., order]."""
        return np.zeros((*np.shape(theta), order))


@once_per_content()
def _transport(curve: Curve, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Solution of (3.4): breakpoints, power coefficients, and e_perp at the last end."""
    sample = curve.flat_sampler(2)
    breaks: list[np.ndarray] = [curve.breakpoints[:1]]
    tables: list[np.ndarray] = []
    for begin, end in zip(curve.breakpoints[:-1], curve.breakpoints[1:], strict=True):
        # The curvature may jump at a breakpoint; the segment's own value counts.
        inside = math.nextafter(float(end), float(begin))

        def rate(theta: float, e_perp: np.ndarray, inside: float = inside) -> Vector:
            _, _, _, dx, dy, dz, cx, cy, cz = sample(min(theta, inside)).tolist()
            x, y, z = e_perp.tolist()
            square = dx * dx + dy * dy + dz * dz
            along = (dx * cx + dy * cy + dz * cz) / square
            # e_par' = (sigma'' - along sigma') / |sigma'|
            bend = (cx - along * dx) * x + (cy - along * dy) * y + (cz - along * dz) * z
            gamma = -bend / square
            return gamma * dx, gamma * dy, gamma * dz

        solution = solve_ivp(
            rate,
            (begin, end),
            normal,
            method="DOP853",
            rtol=_RELATIVE,
            atol=_ABSOLUTE,
            dense_output=True,
        )
        if not solution.success:
            raise InputError(
                f"frame: no solution between theta = {begin:.9g} and {end:.9g};"
                " a regular curve is required"
            )
        steps = np.diff(solution.t)
        nodes = chebyshev_nodes(solution.t[:-1], steps, _DENSE_DEGREE + 1)
        values = solution.sol(nodes.ravel()).T.reshape(*nodes.shape, 3)
        tables.append(power_coefficients(values, steps))
        breaks.append(solution.t[1:])
        tangent = _unit(sample(inside)[3:6])
        normal = solution.y[:, -1]
        normal = _unit(normal - (normal @ tangent) * tangent)
    return np.concatenate(breaks), np.concatenate(tables), normal


def _initial_normal(tangent: np.ndarray, wanted: ArrayLike | None) -> np.ndarray:
    if wanted is None:
        vertical = abs(tangent[2]) > _VERTICAL
        direction = np.array([1.0, 0.0, 0.0] if vertical else [0.0, 0.0, 1.0])
    else:
        direction = np.asarray(wanted, dtype=float)
        if direction.shape != (3,) or not np.all(np.isfinite(direction)):
            raise InputError(f"initial normal: {direction.tolist()}; 3 finite values are required")
    across = direction - (direction @ tangent) * tangent
    if not np.linalg.norm(across) > 1e-6 * np.linalg.norm(direction):
        raise InputError(
            f"initial normal: {direction.tolist()}; a direction not parallel to the tangent"
            f" {tangent.tolist()} is required"
        )
    return _unit(across)


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def manifold_axes(slope: np.ndarray, e_perp: np.ndarray) -> np.ndarray:
    """Return the axes of the path frame as columns ``[e_par, e_perp, e_cross]``, (3.1)-(3.5).

    Args:
        slope: ``sigma'``, in world axes, shape (3,).
        e_perp: First normal vector of the parallel transport frame, shape (3,).
    """
    x, y, z = slope.tolist()
    norm = math.sqrt(x * x + y * y + z * z)
    # a path that stands still has no direction, which is not finite rather than an error
    x, y, z = (x / norm, y / norm, z / norm) if norm > 0.0 else (math.nan,) * 3
    u, v, w = e_perp.tolist()
    return np.array([[x, u, y * w - z * v], [y, v, z * u - x * w], [z, w, x * v - y * u]])


class Frame(Protocol):
    """Orthonormal frame (e_par, e_perp, e_cross) along a curve.

    Attributes:
        turns: Whether it turns about the tangent, by an angle psi against parallel transport.
        holonomy: Angle about e_par from e_perp(theta) to e_perp(theta + period), rad.
        breakpoints: Between two of them it is smooth, [n].
    """

    turns: bool
    holonomy: float
    breakpoints: np.ndarray

    def normals(self, theta: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Both normal vectors e_perp and e_cross, each [..., 3]."""

    def turning(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Derivatives 1..order of psi by theta, rad, [..., order]."""


class TurnedFrame:
    """A parallel transport frame turned by an angle psi about the tangent.

    Args:
        transported: The frame.
        psi: Curve of the angle, rad, of dimension 1.

    Attributes:
        turns: True.
        holonomy: Zero; for open curves only.
        breakpoints: Ends of the pieces on which it is smooth, [n].
    """

    turns = True
    holonomy = 0.0

    def __init__(self, transported: ParallelTransportFrame, psi: Curve) -> None:
        self._transported, self._psi = transported, psi
        self.breakpoints = transported.breakpoints

    def normals(self, theta: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Both normal vectors e_perp and e_cross, each [..., 3]."""
        e_perp, e_cross = self._transported.normals(theta)
        angle = self._psi.derivatives(theta, 0)[..., 0, :]
        c, s = np.cos(angle), np.sin(angle)
        return c * e_perp + s * e_cross, c * e_cross - s * e_perp

    def turning(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Derivatives 1..order of psi by theta, rad, [..., order]."""
        return self._psi.derivatives(theta, order)[..., 1:, 0]
