"""Curves that several tests use."""

import numpy as np
import pytest

from pfsc_drake.geometry import FourierCurve, PiecewisePolynomialCurve, interpolate


@pytest.fixture(scope="session")
def lemniscate() -> FourierCurve:
    return FourierCurve.bent_lemniscate()


@pytest.fixture(scope="session")
def twisted() -> FourierCurve:
    """Closed curve of three harmonics without symmetry: its holonomy is not zero."""
    cosine = [[0.4, 0.0, 0.05], [0.0, 0.06, 0.1], [0.02, 0.0, -0.04]]
    sine = [[0.0, 0.5, 0.0], [0.03, 0.0, 0.08], [0.0, 0.03, 0.05]]
    return FourierCurve([0.1, -0.2, 0.6], cosine, sine)


@pytest.fixture(scope="session")
def bumps() -> PiecewisePolynomialCurve:
    """C^3 curve of exactly straight pieces and random bumps in y and z between them."""
    rng = np.random.default_rng(7)
    coefficients = np.zeros((5, 10, 3))
    coefficients[:, 0, 0] = 0.2 * np.arange(5)
    coefficients[:, 1, 0] = 1.0
    bump = np.polynomial.Polynomial([0, 0, 0, 0, 1]) * np.polynomial.Polynomial([1, -1]) ** 4
    for segment in (1, 3):
        for axis in (1, 2):
            shape = bump * np.polynomial.Polynomial(rng.normal(size=2)) * 6.0
            coefficients[segment, :, axis] = shape.coef / 0.2 ** np.arange(10)
    return PiecewisePolynomialCurve(0.2 * np.arange(6), coefficients)


@pytest.fixture(scope="session")
def open_spline() -> PiecewisePolynomialCurve:
    rng = np.random.default_rng(3)
    angle = np.linspace(0.0, 5.0, 12)
    points = np.stack([0.5 * np.cos(angle), 0.5 * np.sin(angle), 0.1 * angle], axis=1)
    return interpolate(points + 0.02 * rng.normal(size=points.shape), smoothness=5)
