"""A smooth motion of a tool, and how exactly jets along it are to agree with its samples."""

import casadi as ca
import numpy as np
from numpy.polynomial import Chebyshev

from pfsc_drake.jets import Jet

ORDER = 4
HALF_WINDOW = 0.06
# absolute, per order of the derivative; the outputs' derivatives are of the order of one
TOLERANCES = [1e-12, 1e-10, 1e-8, 1e-7, 1e-5]
_DEGREE = 14
NODES = HALF_WINDOW * np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))


def interpolant(samples):
    """Return the polynomial through samples at NODES."""
    return Chebyshev.fit(NODES, samples, _DEGREE, domain=[-HALF_WINDOW, HALF_WINDOW])


def assert_derivatives(jets, samples):
    """Compare derivatives 0..ORDER, one row each, with those of samples at NODES, (nodes, m)."""
    assert samples.shape[1] == jets.shape[1]
    for i, column in enumerate(samples.T):
        fit = interpolant(column)
        for k, tolerance in enumerate(TOLERANCES):
            expected = fit.deriv(k)(0.0) if k else fit(0.0)
            assert abs(jets[k, i] - expected) < tolerance * (1.0 + abs(expected)), (i, k)


class ToolMotion:
    """A smooth motion of the tool, as a function of time and as jets."""

    def __init__(self, start, velocity, angles, rng):
        """Begin at a position with about a velocity and about ZYX angles."""
        drift = rng.uniform(-0.02, 0.02, (ORDER + 1, 3)) + np.outer([0, 1, 0, 0, 0], velocity)
        turns = rng.uniform(-0.15, 0.15, (ORDER + 1, 3))
        drift[0] = start
        turns[0] = angles if np.any(angles) else turns[0]
        t = ca.SX.sym("t")
        powers = ca.vertcat(*[t**k for k in range(ORDER + 1)])
        a, b, c = ca.vertsplit(ca.DM(turns.T) @ powers)
        R_z = ca.blockcat([[ca.cos(a), -ca.sin(a), 0], [ca.sin(a), ca.cos(a), 0], [0, 0, 1]])
        R_y = ca.blockcat([[ca.cos(b), 0, ca.sin(b)], [0, 1, 0], [-ca.sin(b), 0, ca.cos(b)]])
        R_x = ca.blockcat([[1, 0, 0], [0, ca.cos(c), -ca.sin(c)], [0, ca.sin(c), ca.cos(c)]])
        stacked = ca.vertcat(ca.DM(drift.T) @ powers, ca.vec(R_z @ R_y @ R_x))
        self._pose = ca.Function("pose", [t], [stacked])
        derivatives = []
        for _ in range(ORDER + 1):
            derivatives.append(ca.SX(ca.Function("d", [t], [stacked])(0.0)))
            stacked = ca.jacobian(stacked, t)
        self.y = Jet.from_derivatives([d[:3] for d in derivatives])
        self.R = Jet.from_derivatives([ca.reshape(d[3:], 3, 3) for d in derivatives])

    def at(self, t):
        pose = np.array(self._pose(t)).ravel()
        return pose[:3], pose[3:].reshape(3, 3, order="F")
