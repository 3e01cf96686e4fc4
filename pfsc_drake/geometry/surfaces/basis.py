"""Basis functions of one parameter of a surface, each set closed under derivation."""

import math
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Callable, Sequence
from typing import ClassVar

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.curves.fourier_curve import FourierCurve
from pfsc_drake.geometry.curves.polynomial import PiecewisePolynomialCurve

Values = Callable[[float], tuple[int, Sequence[float]]]


class Basis(ABC):
    """Scalar functions b_0 = 1, b_1, ... of a parameter on pieces of an interval.

    Their derivatives are sums of themselves, b' = D b with the same D on all pieces.

    Attributes:
        breakpoints: Ends of the pieces, [pieces + 1].
        closed: Whether the parameter is periodic.
        derivation: D, [size, size].
        is_local: Whether they are functions of the distance from the piece's begin.
    """

    is_local: ClassVar[bool]

    def __init__(self, breakpoints: ArrayLike, derivation: np.ndarray, *, closed: bool) -> None:
        self.breakpoints = np.array(breakpoints, dtype=float)
        self.derivation = derivation
        self.closed = closed

    @property
    def size(self) -> int:
        """Number of functions."""
        return len(self.derivation)

    @property
    def pieces(self) -> int:
        """Number of pieces."""
        return len(self.breakpoints) - 1

    def derivations(self, order: int) -> np.ndarray:
        """Return D^0 .. D^order, [order + 1, size, size]."""
        return np.array([np.linalg.matrix_power(self.derivation, n) for n in range(order + 1)])

    @abstractmethod
    def values(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pieces [...] and functions [..., size] at wrapped parameters [...]."""

    @abstractmethod
    def at(self, u: ca.SX) -> ca.SX:
        """Return functions of theta, or of its distance from the piece's begin, [size]."""

    def function(self, order: int) -> ca.Function:
        """Return ``u -> derivatives 0..order``, [order + 1, size], with u as `at` has it."""
        u = ca.SX.sym("u")
        values = self.at(u)
        rows = [(ca.sparsify(ca.DM(D)) @ values).T for D in self.derivations(order)]
        return ca.Function("functions", [u], [ca.densify(ca.vertcat(*rows))])

    @abstractmethod
    def sampler(self) -> Values:
        """Return a fast scalar form of `values`; it wraps where closed, extrapolates where open."""


class TrigonometricBasis(Basis):
    """1, cos(theta), sin(theta), cos(2 theta), ... on one piece.

    Args:
        domain: First and last parameter, rad.
        harmonics: Their number, at least 1.
        closed: Whether the domain is a full turn that closes.
    """

    is_local = False

    def __init__(self, domain: tuple[float, float], harmonics: int, *, closed: bool) -> None:
        derivation = np.zeros((2 * harmonics + 1, 2 * harmonics + 1))
        for k in range(1, harmonics + 1):
            derivation[2 * k - 1, 2 * k], derivation[2 * k, 2 * k - 1] = -k, k
        super().__init__(domain, derivation, closed=closed)
        self._harmonics = harmonics

    def values(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pieces [...] and functions [..., size] at wrapped parameters [...]."""
        angles = theta[..., None] * np.arange(1, self._harmonics + 1)
        values = np.ones((*theta.shape, self.size))
        values[..., 1::2], values[..., 2::2] = np.cos(angles), np.sin(angles)
        return np.zeros(theta.shape, dtype=int), values

    def at(self, u: ca.SX) -> ca.SX:
        """Return functions of theta, or of its distance from the piece's begin, [size]."""
        waves = [(ca.cos(k * u), ca.sin(k * u)) for k in range(1, self._harmonics + 1)]
        return ca.vertcat(1.0, *[value for wave in waves for value in wave])

    def sampler(self) -> Values:
        """Return a fast scalar form of `values`; it wraps where closed, extrapolates where open."""
        cos, sin, harmonics = math.cos, math.sin, range(2, self._harmonics + 1)

        def first(theta: float) -> tuple[int, Sequence[float]]:
            return 0, (1.0, cos(theta), sin(theta))

        def all_of_them(theta: float) -> tuple[int, Sequence[float]]:
            values = [1.0, cos(theta), sin(theta)]
            for k in harmonics:
                values += (cos(k * theta), sin(k * theta))
            return 0, values

        return first if self._harmonics == 1 else all_of_them


class PowerBasis(Basis):
    """1, u, u^2, ..., u^degree with u = theta - begin of the piece.

    Args:
        breakpoints: Ends of the pieces, [pieces + 1].
        degree: Highest power.
        closed: Whether theta is periodic.
    """

    is_local = True

    def __init__(self, breakpoints: ArrayLike, degree: int, *, closed: bool = False) -> None:
        derivation = np.diag(np.arange(1.0, degree + 1), -1)
        super().__init__(breakpoints, derivation, closed=closed)

    def values(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pieces [...] and functions [..., size] at wrapped parameters [...]."""
        piece = np.searchsorted(self.breakpoints[1:-1], theta, side="right")
        u = theta - self.breakpoints[piece]
        return piece, u[..., None] ** np.arange(self.size)

    def at(self, u: ca.SX) -> ca.SX:
        """Return functions of theta, or of its distance from the piece's begin, [size]."""
        powers = [ca.SX(1.0)]
        for _ in range(1, self.size):
            powers.append(powers[-1] * u)
        return ca.vertcat(*powers)

    def sampler(self) -> Values:
        """Return a fast scalar form of `values`; it wraps where closed, extrapolates where open."""
        starts, interior = self.breakpoints[:-1].tolist(), self.breakpoints[1:-1].tolist()
        begin, end = float(self.breakpoints[0]), float(self.breakpoints[-1])
        closed, powers = self.closed, range(2, self.size)

        def sample(theta: float) -> tuple[int, Sequence[float]]:
            if closed and not begin <= theta <= end:
                theta -= math.floor((theta - begin) / (end - begin)) * (end - begin)
            piece = bisect_right(interior, theta)
            power = u = theta - starts[piece]
            values = [1.0, u]
            for _ in powers:
                power *= u
                values.append(power)
            return piece, values

        return sample


def curve_on_basis(
    curve: Curve, domain: tuple[float, float] | None = None
) -> tuple[Basis, np.ndarray]:
    """Return a curve as the sum of basis functions.

    Args:
        curve: A Fourier series or piecewise polynomials.
        domain: Part of a Fourier series; all of the curve by default.

    Returns:
        The basis, of two functions or more, and coefficients [pieces, size, dimension].

    Raises:
        InputError: Another kind of curve, or a part that is not one.
    """
    if isinstance(curve, FourierCurve):
        begin, end = domain or curve.domain
        if not 0.0 < end - begin < math.inf:
            raise InputError(f"part of a curve: [{begin}, {end}]; must be finite and increase")
        if domain and end - begin > curve.period * (1.0 + 1e-12):
            raise InputError(
                f"part of a curve: [{begin:.9g}, {end:.9g}]; at most the period"
                f" {curve.period:.9g} is allowed"
            )
        waves = np.stack([curve.cosine, curve.sine], axis=1).reshape(-1, curve.dimension)
        basis = TrigonometricBasis((begin, end), len(curve.cosine), closed=domain is None)
        return basis, np.vstack([curve.constant, waves])[None]
    if isinstance(curve, PiecewisePolynomialCurve) and domain is None:
        table = curve.coefficients
        if table.shape[1] == 1:
            table = np.concatenate([table, np.zeros_like(table)], axis=1)
        degree = table.shape[1] - 1
        return PowerBasis(curve.breakpoints, degree, closed=curve.closed), table
    raise InputError(
        f"profile: {type(curve).__name__}{' in part' if domain else ''};"
        " a whole piecewise polynomial curve, or (part of) a Fourier curve is required"
    )
