"""Parallel transport frame along a curve, and a frame turned about the tangent."""

import math
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.piecewise_fit import chebyshev_nodes, power_coefficients
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve

# of e_perp on an interval; by Gauss' points for its rate
_DEGREE = 8
_STAGES = 0.5 * (np.polynomial.legendre.leggauss(_DEGREE)[0] + 1.0)
# points at which the solution is checked, the residual that is allowed there times an interval's
# length, and the shortest interval as a share of the domain
_BETWEEN = 0.5 * (np.append(_STAGES, 1.0) + np.insert(_STAGES, 0, 0.0))
_RESIDUAL, _SHORTEST = 1e-12, 1e-12
_VERTICAL = 0.9


class ParallelTransportFrame:
    """Orthonormal frame (e_par, e_perp, e_cross) that does not turn about the tangent.

    e_par = sigma'/|sigma'| (3.1); e_perp solves (3.4), e_perp' = -(e_par' . e_perp) e_par,
    from the begin of the domain; e_cross = e_par x e_perp (3.5). Defined where the curvature
    is zero. The equation is solved once, so the frame is a function of theta alone: unlike
    the iteration (3.81) it needs no memory and does not depend on the speed.

    On a closed curve the frame comes back turned about e_par by the holonomy angle;
    e_perp then also depends on the revolution, which follows from the unwrapped theta.

    Args:
        curve: Regular curve in R^3, at least of class C^1.
        initial_normal: e_perp at the begin of the domain, [3]; its part perpendicular to the
            tangent is normalized. The default is the direction closest to the world's
            z, or x where the tangent is within 26 degrees of z.

    Attributes:
        turns: False: it does not turn about the tangent.
        holonomy: Angle from e_perp(theta) to e_perp(theta + period) about e_par, rad, in
            (-pi, pi]; zero for an open curve.
        breakpoints: Ends of the intervals in which e_perp is smooth, with those of the curve, [n].

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
        """Return both normal vectors.

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
        revolutions = self._curve.revolutions(values)
        local = np.clip(values - revolutions * self._curve.period, *self._curve.domain)
        e_perp = self._table.derivatives(local, 0)[..., 0, :]
        along = np.sum(e_perp * tangents, axis=-1, keepdims=True)
        e_perp = _unit(e_perp - along * tangents)
        e_cross = np.cross(tangents, e_perp)
        turn = (revolutions * self.holonomy)[..., None]
        c, s = np.cos(turn), np.sin(turn)
        return c * e_perp + s * e_cross, c * e_cross - s * e_perp

    def turning(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Return derivatives 1..order of the angle by which it turns, all zero, [..., order]."""
        return np.zeros((*np.shape(theta), order))


@once_per_content()
def _transport(curve: Curve, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Solve (3.4); return breakpoints, power coefficients, and e_perp at the last end."""
    begins, lengths, turns = _turns(curve)
    ends = np.append(begins[1:], curve.breakpoints[-1])
    # the curvature may jump at a breakpoint; the interval's own value counts
    tangents = _unit(curve.derivatives(np.nextafter(ends, begins), 1)[:, 1])
    nodes = chebyshev_nodes(np.zeros(1), np.ones(1), _DEGREE + 1)[0]
    at_nodes = np.tensordot(_integrals(nodes), turns, axes=(1, 1)).swapaxes(0, 1)
    at_end = np.tensordot(_integrals(np.ones(1)), turns, axes=(1, 1))[0]
    values = np.empty((len(begins), len(nodes), 3))
    for k, (whole, parts, tangent) in enumerate(zip(at_end, at_nodes, tangents, strict=True)):
        values[k] = normal + parts @ normal
        normal = normal + whole @ normal
        normal = normal - (normal @ tangent) * tangent
        normal = normal / math.sqrt(normal @ normal)
    return np.append(begins, ends[-1]), power_coefficients(values, lengths), normal


def _turns(curve: Curve) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Solve (3.4) for every normal, on intervals that are as short as needed.

    With ``Omega = e_par x e_par'`` the normal obeys ``e_perp' = Omega x e_perp``, linear and with
    known coefficients. ``Phi' = [Omega]x Phi`` with ``Phi = 1`` at the begin of an interval is
    solved by collocation on all intervals together; intervals whose residual is too large are
    halved and solved again.

    Returns:
        Begins and lengths of the intervals, each (n,), and ``Phi'`` times the length at the
        collocation points, (n, s, 3, 3).
    """
    begins, ends = curve.breakpoints[:-1], curve.breakpoints[1:]
    shortest = _SHORTEST * (ends[-1] - begins[0])
    nodes = np.concatenate([_STAGES, _BETWEEN])
    found: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    while len(begins):
        lengths = ends - begins
        A = _angular_rate(curve, begins[:, None] + lengths[:, None] * nodes)
        A = A * lengths[:, None, None, None]
        stages, between = A[:, : len(_STAGES)], A[:, len(_STAGES) :]
        system = -np.einsum("ij,niab->niajb", _integrals(_STAGES), stages)
        size = 3 * len(_STAGES)
        system = system.reshape(-1, size, size) + np.eye(size)
        K = np.linalg.solve(system, stages.reshape(-1, size, 3)).reshape(stages.shape)
        Phi = np.eye(3) + np.einsum("ij,njab->niab", _integrals(_BETWEEN), K)
        rate = np.einsum("ij,njab->niab", _values(_BETWEEN), K)
        residual = np.abs(rate - between @ Phi).max(axis=(1, 2, 3))
        good = residual <= _RESIDUAL
        if not np.isfinite(residual).all() or (lengths[~good] < shortest).any():
            worst = int(np.argmax(np.where(np.isfinite(residual), residual, np.inf)))
            raise InputError(
                f"frame: no solution between theta = {begins[worst]:.9g} and {ends[worst]:.9g};"
                " a regular curve is required"
            )
        found.append((begins[good], lengths[good], K[good]))
        middles = 0.5 * (begins + ends)[~good]
        begins = np.concatenate([begins[~good], middles])
        ends = np.concatenate([middles, ends[~good]])
    parts = [np.concatenate(part) for part in zip(*found, strict=True)]
    order = np.argsort(parts[0])
    begins, lengths, K = (part[order] for part in parts)
    return begins, lengths, K


def _angular_rate(curve: Curve, theta: np.ndarray) -> np.ndarray:
    """Return the cross product matrix of ``e_par x e_par'``, [..., 3, 3]."""
    slope, bend = np.moveaxis(curve.derivatives(theta, 2)[..., 1:, :], -2, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        x, y, z = np.moveaxis(
            np.cross(slope, bend) / np.sum(slope**2, axis=-1, keepdims=True), -1, 0
        )
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def _values(points: np.ndarray) -> np.ndarray:
    """Return Lagrange's polynomials of the collocation points at points in [0, 1], (points, s)."""
    degree = len(_STAGES) - 1
    basis = np.polynomial.legendre.legvander(2.0 * _STAGES - 1.0, degree)
    return np.linalg.solve(
        basis.T, np.polynomial.legendre.legvander(2.0 * points - 1.0, degree).T
    ).T


def _integrals(points: np.ndarray) -> np.ndarray:
    """Return the integrals of Lagrange's polynomials from 0 on, (points, s)."""
    nodes, weights = np.polynomial.legendre.leggauss(len(_STAGES))
    within = points[:, None] * 0.5 * (nodes + 1.0)
    values = _values(within.ravel()).reshape(*within.shape, -1)
    return 0.5 * points[:, None] * np.einsum("k,pks->ps", weights, values)


def _initial_normal(tangent: np.ndarray, requested: ArrayLike | None) -> np.ndarray:
    if requested is None:
        vertical = abs(tangent[2]) > _VERTICAL
        direction = np.array([1.0, 0.0, 0.0] if vertical else [0.0, 0.0, 1.0])
    else:
        direction = np.asarray(requested, dtype=float)
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
    # where the derivative vanishes there is no direction: NaN rather than an error
    x, y, z = (x / norm, y / norm, z / norm) if norm > 0.0 else (math.nan,) * 3
    u, v, w = e_perp.tolist()
    return np.array([[x, u, y * w - z * v], [y, v, z * u - x * w], [z, w, x * v - y * u]])


class Frame(Protocol):
    """Orthonormal frame (e_par, e_perp, e_cross) along a curve.

    Attributes:
        turns: Whether it turns about the tangent, by an angle psi against parallel transport.
        holonomy: Angle about e_par from e_perp(theta) to e_perp(theta + period), rad.
        breakpoints: Ends of the intervals in which it is smooth, [n].
    """

    turns: bool
    holonomy: float
    breakpoints: np.ndarray

    def normals(self, theta: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return both normal vectors e_perp and e_cross, each [..., 3]."""

    def turning(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Return derivatives 1..order of psi by theta, rad, [..., order]."""


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
        """Return both normal vectors e_perp and e_cross, each [..., 3]."""
        e_perp, e_cross = self._transported.normals(theta)
        angle = self._psi.derivatives(theta, 0)[..., 0, :]
        c, s = np.cos(angle), np.sin(angle)
        return c * e_perp + s * e_cross, c * e_cross - s * e_perp

    def turning(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Return derivatives 1..order of psi by theta, rad, [..., order]."""
        return self._psi.derivatives(theta, order)[..., 1:, 0]
