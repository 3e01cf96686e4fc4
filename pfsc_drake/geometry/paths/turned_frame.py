"""Frames along a curve that turn about its tangent."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.paths.frame import ParallelTransportFrame


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
        breakpoints: See `Frame`.
    """

    turns = True
    holonomy = 0.0

    def __init__(self, transported: ParallelTransportFrame, psi: Curve) -> None:
        self._transported, self._psi = transported, psi
        self.breakpoints = transported.breakpoints

    def normals(self, theta: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """See `Frame`."""
        e_perp, e_cross = self._transported.normals(theta)
        angle = self._psi.derivatives(theta, 0)[..., 0, :]
        c, s = np.cos(angle), np.sin(angle)
        return c * e_perp + s * e_cross, c * e_cross - s * e_perp

    def turning(self, theta: ArrayLike, order: int) -> np.ndarray:
        """See `Frame`."""
        return self._psi.derivatives(theta, order)[..., 1:, 0]
