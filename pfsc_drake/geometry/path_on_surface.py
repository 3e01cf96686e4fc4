"""Paths on a surface, whose frame holds the surface's normal."""

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from pfsc_drake import jets
from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.curve import Curve, Sampler, check_order
from pfsc_drake.geometry.curves.orientation import OrientationCurve
from pfsc_drake.geometry.paths.path import Path
from pfsc_drake.geometry.surfaces.partials import partial_index, partial_orders
from pfsc_drake.geometry.surfaces.surface import Surface
from pfsc_drake.jets import Jet

# Between two breakpoints of a curve, to find where it leaves a cell of the surface.
_SAMPLES = 129


class CurveOnSurface(Curve):
    """The curve ``sigma_t(c(theta))`` of a surface and a curve c of its parameters.

    Args:
        surface: The surface sigma_t.
        parameters: Curve c in the surface's parameters, of dimension 2; in closed directions of
            the surface it may lead on and on.

    Attributes:
        surface: The surface.

    Raises:
        InputError: The curve is not two-dimensional, or leaves the surface.
    """

    def __init__(self, surface: Surface, parameters: Curve) -> None:
        if parameters.dimension != 2:
            raise InputError(
                f"path on a surface: curve of dimension {parameters.dimension}; 2 is required"
            )
        breakpoints = _with_seams(surface, parameters)
        smoothness = min(surface.smoothness, parameters.smoothness)
        super().__init__(3, breakpoints, closed=parameters.closed, smoothness=smoothness)
        self.surface, self._parameters = surface, parameters
        surface.checked(parameters.derivatives(np.linspace(*parameters.domain, 257), 0)[:, 0])

    def derivatives(self, theta: ArrayLike, order: int) -> np.ndarray:
        """See the base class."""
        jet = self._composed(theta, check_order(order), [(0, 0)])[0]
        return np.stack(jet.derivatives(), axis=-2)

    def flat_sampler(self, order: int) -> Sampler:
        """See the base class."""
        return lambda theta: self.derivatives(theta, order).ravel()

    def normals(self, theta: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """The surface's normal e_perp (4.3), and e_cross = e_par x e_perp, each [..., 3]."""
        e_par, normal = self._axes(theta, 0)
        return normal.coefficients[0], np.cross(e_par.coefficients[0], normal.coefficients[0])

    def turning(self, theta: ArrayLike, order: int) -> np.ndarray:
        """Derivatives 1..order of psi, whose first is speed times geodesic torsion, [..., order].

        ``psi' = (e_par x e_perp) . e_perp'``.
        """
        e_par, normal = self._axes(theta, order)
        rate = _dot(jets.cross(e_par, normal), normal.differentiate())
        return np.stack(rate.derivatives(), axis=-2)[..., 0]

    def _axes(self, theta: ArrayLike, order: int) -> tuple[Jet, Jet]:
        """Tangent and normal as jets by theta, coefficients [..., 3]."""
        position = self._composed(theta, order + 1, [(0, 0)])[0].differentiate()
        first, second = self._composed(theta, order, [(1, 0), (0, 1)])
        return _unit(position), _unit(jets.cross(first, second))

    def _composed(self, theta: ArrayLike, order: int, which: list[tuple[int, int]]) -> list[Jet]:
        """Partial derivatives of the surface along the curve as jets by theta, [..., 3]."""
        c = self._parameters.derivatives(theta, order)
        pair = [
            Jet.from_derivatives([c[..., k, i, None] for k in range(order + 1)]) for i in (0, 1)
        ]
        highest = order + max(i + j for i, j in which)
        partials = self.surface.partials(c[..., 0, :], highest)
        return [
            jets.compose_pair(
                [partials[..., partial_index(i + a, j + b), :] for i, j in partial_orders(order)],
                *pair,
            )
            for a, b in which
        ]


class SurfaceNormalFrame:
    """The frame along a curve on a surface whose e_perp is the surface's normal.

    Args:
        curve: The curve.

    Attributes:
        turns: True.
        holonomy: Zero: where the curve closes, so does the frame.
        breakpoints: See `Frame`.
    """

    turns = True
    holonomy = 0.0

    def __init__(self, curve: CurveOnSurface) -> None:
        self.normals, self.turning = curve.normals, curve.turning
        self.breakpoints = curve.breakpoints


def path_on_surface(
    surface: Surface, parameters: Curve, orientation: OrientationCurve | None = None
) -> Path:
    """Return a path on a surface whose transversal coordinates are normal and sideways.

    xi_1 is the distance along the surface's normal, xi_2 the side step along e_par x e_perp.

    Args:
        surface: Surface of class C^2 or better.
        parameters: Curve in its parameters, of dimension 2.
        orientation: Quaternions over the same parameter, or None.

    Raises:
        InputError: The curve leaves the surface, is no curve in its parameters, or not regular.
    """
    curve = CurveOnSurface(surface, parameters)
    return Path(curve, orientation, frame=SurfaceNormalFrame(curve))


def _with_seams(surface: Surface, parameters: Curve) -> np.ndarray:
    """Breakpoints of a curve, with the places where it enters another cell of the surface."""
    grid = np.unique(np.linspace(parameters.breakpoints[:-1], parameters.breakpoints[1:], _SAMPLES))
    values = parameters.derivatives(grid, 0)[:, 0]
    seams = [parameters.breakpoints]
    for k, (breaks, closed) in enumerate(zip(surface.breakpoints, surface.closed, strict=True)):
        if len(breaks) == 2 and (not closed or surface.smoothness == math.inf):
            continue
        own, period = values[:, k], breaks[-1] - breaks[0]
        laps = np.arange(
            math.floor((own.min() - breaks[0]) / period),
            math.ceil((own.max() - breaks[0]) / period),
        )
        levels = np.unique(breaks + period * laps[:, None]) if closed else breaks[1:-1]
        for level in levels:
            for i in np.flatnonzero((own[:-1] - level) * (own[1:] - level) < 0.0):
                seams.append(_crossing(parameters, k, level, (grid[i], grid[i + 1])))
    return np.unique(np.concatenate(seams))


def _crossing(parameters: Curve, k: int, level: float, between: tuple[float, float]) -> np.ndarray:
    """Where a component of a curve has a value, [1]."""

    def excess(theta: float) -> float:
        return float(parameters.derivatives(theta, 0)[0, k]) - level

    return np.array([brentq(excess, *between, xtol=1e-15)])


def _unit(x: Jet) -> Jet:
    return x / jets.sqrt(_dot(x, x))


def _dot(x: Jet, y: Jet) -> Jet:
    return jets.bilinear(lambda a, b: np.sum(a * b, axis=-1, keepdims=True), x, y)
