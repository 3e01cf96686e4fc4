"""Reference of the virtual output over time."""

import numpy as np
from pydrake.polynomial import Polynomial
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from pfsc_drake.geometry import PiecewisePolynomialCurve


class ReferenceGenerator(Diagram):
    """Motion along a manifold over time; transversal and rotational references are zero.

    Ports:
        reference (output): Derivatives 0..r of ``yhat_p = (eta_p, 0, ..)`` by rows,
            shape ((r + 1) m,) [m, m/s, ...].

    Args:
        eta_p: Tangential reference [m] over time [s], a curve of as many dimensions as there are
            tangential coordinates; before its domain and after it the reference rests.
        relative_degree: ``r``.
        num_outputs: ``m``.
    """

    def __init__(
        self, eta_p: PiecewisePolynomialCurve, relative_degree: int, num_outputs: int
    ) -> None:
        super().__init__()
        builder = DiagramBuilder()
        source = builder.AddSystem(
            TrajectorySource(
                _trajectory(eta_p, num_outputs),
                output_derivative_order=relative_degree,
                zero_derivatives_beyond_limits=True,
            )
        )
        builder.ExportOutput(source.get_output_port(), "reference")
        builder.BuildInto(self)


def _trajectory(eta_p: PiecewisePolynomialCurve, num_outputs: int) -> PiecewisePolynomial:
    """(eta_p, 0, ..) over time, (num_outputs, 1)."""
    rest = [[Polynomial(0.0)]] * (num_outputs - eta_p.coefficients.shape[2])
    pieces = [
        np.array([*([Polynomial(coordinate)] for coordinate in coefficients.T), *rest])
        for coefficients in eta_p.coefficients
    ]
    return PiecewisePolynomial(pieces, eta_p.breakpoints)
