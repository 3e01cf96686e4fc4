"""Trajectory tracking errors against differentiation along a prescribed motion."""

import casadi as ca
import numpy as np

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
    geometry = PathGeometry(ca.SX(0), ca.SX(3, 1), [ca.SX(ca.DM(s)) for s in sigma], [])
    y = Jet.from_derivatives([ca.SX(ca.DM(m)) for m in motion])
    eta_d = Jet.from_derivatives([ca.SX(p) for p in progress])
    errors = trajectory_errors(y, y, geometry, eta_d)
    found = np.array([[float(ca.DM(e.derivative(k))) for e in errors] for k in range(ORDER + 1)])

    def error(t):
        powers = np.array([t**k / np.prod(range(1, k + 1)) for k in range(ORDER + 1)])
        point = path.position.derivatives(path.arc_length.parameter(powers @ progress), 0)[0]
        return powers @ motion - point

    # Chebyshev interpolation of the error over a short time, differentiated
    span = 0.05
    nodes = np.cos(np.pi * (np.arange(17) + 0.5) / 17)
    fit = np.polynomial.Chebyshev.fit
    values = np.array([error(span * x) for x in nodes])
    for axis in range(3):
        series = fit(nodes, values[:, axis], 16, domain=[-1.0, 1.0])
        for k in range(ORDER + 1):
            expected = series.deriv(k)(0.0) / span**k if k else series(0.0)
            assert abs(found[k, axis] - expected) < 1e-12 * 100.0**k + 1e-10
