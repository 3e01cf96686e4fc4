"""Fourier curves against (3.87) and Cauchy's integral formula."""

import cmath
import math

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import FourierCurve


def test_bent_lemniscate_is_3_87(lemniscate: FourierCurve) -> None:
    theta = np.linspace(-4.0, 9.0, 60)
    c, s = np.cos(theta), np.sin(theta)
    expected = np.stack([0.25 * c + 0.7, 0.25 * s * c + 0.2, 0.1 * s**2 + 1.103], axis=1)
    np.testing.assert_allclose(lemniscate.derivatives(theta, 0)[:, 0], expected, atol=1e-15)


def test_derivatives_by_contour_integral(lemniscate: FourierCurve, twisted: FourierCurve) -> None:
    # Cauchy's formula on the series itself: no rule of differentiation is used.
    count, radius = 64, 0.7
    for curve in (lemniscate, twisted):
        for theta in (0.0, 1.1, 4.2):
            found = curve.derivatives(theta, 6)
            for axis in range(3):
                values = []
                for node in range(count):
                    z = theta + radius * cmath.exp(2j * math.pi * node / count)
                    value = complex(curve.constant[axis])
                    for k, (a, b) in enumerate(zip(curve.cosine, curve.sine, strict=True), 1):
                        value += a[axis] * cmath.cos(k * z) + b[axis] * cmath.sin(k * z)
                    values.append(value)
                taylor = np.fft.fft(values).real / count
                expected = [taylor[k] / radius**k * math.factorial(k) for k in range(7)]
                np.testing.assert_allclose(found[:, axis], expected, atol=1e-10)


def test_circle() -> None:
    circle = FourierCurve.circle([1.0, 2.0, 3.0], 0.5, [0, 0, 2.0], [0, 3.0, 1.0])
    np.testing.assert_allclose(circle.derivatives(0.0, 1), [[1, 2, 3.5], [0, 0.5, 0]], atol=1e-15)
    points = circle.derivatives(np.linspace(0, 7, 30), 0)[:, 0]
    np.testing.assert_allclose(np.linalg.norm(points - [1, 2, 3], axis=1), 0.5)
    assert circle.closed
    assert circle.smoothness == math.inf
    assert circle.first_discontinuity(100) is None


def test_errors() -> None:
    with pytest.raises(InputError, match="circle radius: -1"):
        FourierCurve.circle([0, 0, 0], -1.0)
    with pytest.raises(InputError, match=r"0 deg between them; at least 0\.1 deg"):
        FourierCurve.circle([0, 0, 0], 1.0, [1, 0, 0], [-2, 0, 0])
    with pytest.raises(InputError, match="shapes"):
        FourierCurve([0, 0], [[1, 0, 0]], [[0, 1, 0]])
    with pytest.raises(InputError, match="finite"):
        FourierCurve([0, math.inf], [[1, 0]], [[0, 1]])
