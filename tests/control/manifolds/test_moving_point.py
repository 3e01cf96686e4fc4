"""Trajectory tracking errors against differentiation along a prescribed motion."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.control.manifolds.moving_point import trajectory_errors
from pfsc_drake.control.manifolds.path import PathGeometry
from pfsc_drake.geometry import FourierCurve, Path
from pfsc_drake.jets import Jet

ORDER = 4


def test_errors_are_those_from_the_moving_point():
    path = Path(FourierCurve.bent_lemniscate())
    rng = np.random.default_rng(3)
    motion = rng.uniform(-0.3, 0.3, size=(ORDER + 1, 3)) + np.array(
        [[0.7, 0.2, 1.1]] + [[0] * 3] * ORDER
    )
    progress = np.array([0.4, 0.9, -0.7, 0.5, 0.3])

    theta = path.arc_length.parameter(progress[0])
    sigma = path.position.derivatives(theta, ORDER + 1)
    e_par = sigma[1] / np.linalg.norm(sigma[1])
    normal = np.cross(e_par, [0.0, 0.6, 0.8])
    normal /= np.linalg.norm(normal)
    geometry = PathGeometry(ca.SX(0), ca.SX(ca.DM(normal)), [ca.SX(ca.DM(s)) for s in sigma], [])
    y = Jet.from_derivatives([ca.SX(ca.DM(m)) for m in motion])
    eta_d = Jet.from_derivatives([ca.SX(p) for p in progress])
    errors = trajectory_errors(y, y, geometry, eta_d)

    def along(t):
        """Return the error along the tangent, and its square."""
        powers = np.array([t**k / np.prod(range(1, k + 1)) for k in range(ORDER + 1)])
        theta = path.arc_length.parameter(powers @ progress)
        point, slope = path.position.derivatives(theta, 1)
        error = powers @ motion - point
        return [error @ slope / np.linalg.norm(slope), error @ error]

    square = errors[0] * errors[0] + errors[1] * errors[1] + errors[2] * errors[2]
    # Chebyshev interpolation over a short time, differentiated
    span = 0.05
    nodes = np.cos(np.pi * (np.arange(17) + 0.5) / 17)
    values = np.array([along(span * x) for x in nodes])
    for column, jet in enumerate((errors[0], square)):
        series = np.polynomial.Chebyshev.fit(nodes, values[:, column], 16, domain=[-1.0, 1.0])
        for k in range(ORDER + 1):
            expected = series.deriv(k)(0.0) / span**k if k else series(0.0)
            assert abs(float(ca.DM(jet.derivative(k))) - expected) < 1e-12 * 100.0**k + 1e-10

    # across, by the equation of parallel transport (3.4)
    error, velocity = motion[0] - sigma[0], motion[1] - progress[1] * e_par
    bend = (sigma[2] - (sigma[2] @ e_par) * e_par) / (sigma[1] @ sigma[1]) * progress[1]
    for jet, axis in zip(errors[1:3], (normal, np.cross(e_par, normal)), strict=True):
        assert float(ca.DM(jet.derivative(0))) == pytest.approx(axis @ error, rel=1e-12)
        rate = axis @ velocity - (bend @ axis) * (e_par @ error)
        assert float(ca.DM(jet.derivative(1))) == pytest.approx(rate, rel=1e-9)
