"""Samples of surfaces, and what is refused before anything moves."""

import math

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    PiecewisePolynomialCurve,
    ProductSurface,
    cylinder,
    extruded_surface,
    interpolate,
    paraboloid,
    plane,
    torus,
)
from pfsc_drake.geometry.surfaces.basis import PowerBasis, TrigonometricBasis
from pfsc_drake.geometry.surfaces.regularity import sample_grid

UP = (0.0, 0.0, 1.0)


def _profile(points):
    return interpolate(np.array(points), smoothness=3)


def test_samples_are_as_fine_as_the_surface_is_bent():
    assert sample_grid(plane((1.0, 2.0))).position.shape == (33, 33, 3)
    deep = sample_grid(paraboloid(((-0.3, 0.3), (-0.3, 0.3)), 12.5))
    assert max(deep.turning(0).max(), deep.turning(1).max()) < 0.3
    ring = sample_grid(torus(0.5, 0.1))
    assert ring.position.shape == (32, 32, 3)
    # The last sample of a closed direction is next to the first.
    assert ring.spacing(0).shape == (32, 32)
    np.testing.assert_allclose(ring.turning(1), 2.0 * math.pi / 32, rtol=1e-9)


def test_a_sharply_rounded_edge_is_no_flip():
    """It turns by more than a right angle between two samples, but it turns."""
    radius, length = 1e-4, 1.0
    angle = np.linspace(0.0, math.pi, 40)
    bend = np.column_stack([length + radius * np.sin(angle), radius - radius * np.cos(angle)])
    along = np.linspace(0.0, length, 40)[:-1]
    flat = np.column_stack([along, np.zeros(39)])
    back = np.column_stack([along[::-1], np.full(39, 2.0 * radius)])
    points = np.zeros((118, 3))
    points[:, :2] = np.vstack([flat, bend, back])
    surface = extruded_surface(_profile(points), UP, 0.1)
    assert np.max(sample_grid(surface).turning(0)) < math.pi


def test_an_edge_is_a_flip():
    """A polynomial that turns back on its own way at a cusp."""
    cusp = PiecewisePolynomialCurve(
        [-1.0, 0.0, 1.1],
        [
            [[1, -1, 0], [-2, 3, 0], [1, -3, 0], [0, 1, 0]],
            [[0, 0, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]],
        ],
    )
    with pytest.raises(InputError, match=r"not regular at theta|its normal flips at theta = \["):
        extruded_surface(cusp, UP, 1.0)


def test_a_seam_that_does_not_close():
    first = TrigonometricBasis((0.0, 6.0), 1, closed=True)
    coefficients = np.zeros((1, 1, 3, 2, 3))
    coefficients[0, 0, 1, 0] = [0.1, 0.0, 0.0]
    coefficients[0, 0, 2, 0] = [0.0, 0.1, 0.0]
    coefficients[0, 0, 0, 1] = [0.0, 0.0, 1.0]
    surface = ProductSurface(first, PowerBasis([0.0, 1.0], 1), coefficients, smoothness=math.inf)
    with pytest.raises(InputError, match="does not close smoothly in theta_1 at theta_2 = 0"):
        sample_grid(surface)


@pytest.mark.parametrize(
    "make",
    [
        lambda: cylinder(1e-6, (0.0, 1.0)),
        lambda: plane((1.0, 1e-5)),
        lambda: plane((1.0, 1.0), origin=(0.0, 1e5, 0.0)),
    ],
    ids=["thin", "narrow", "far"],
)
def test_sizes(make):
    with pytest.raises(InputError, match=r"at least 0.0001 m each way, and at most 10000 m away"):
        make()


def test_coefficients_that_are_none():
    basis = PowerBasis([0.0, 1.0], 1)
    with pytest.raises(InputError, match=r"shape \(1, 1, 2, 3, 3\); \(1, 1, 2, 2, 3\)"):
        ProductSurface(basis, basis, np.zeros((1, 1, 2, 3, 3)), smoothness=math.inf)
    with pytest.raises(InputError, match="not finite"):
        ProductSurface(basis, basis, np.full((1, 1, 2, 2, 3), math.nan), smoothness=math.inf)
    backwards = PowerBasis([0.0, -1.0], 1)
    with pytest.raises(InputError, match="breakpoints of theta_2"):
        ProductSurface(basis, backwards, np.zeros((1, 1, 2, 2, 3)), smoothness=math.inf)


def test_a_closed_profile_with_a_kink_is_refused():
    """A drop: its ends meet, at an angle."""
    side = PowerBasis([0.0, 1.0], 3, closed=True)
    coefficients = np.zeros((1, 1, 4, 2, 3))
    # x = u (1 - u), y = u (1 - u) (1 - 2 u)
    coefficients[0, 0, :, 0, 0] = [0.0, 1.0, -1.0, 0.0]
    coefficients[0, 0, :, 0, 1] = [0.0, 1.0, -3.0, 2.0]
    coefficients[0, 0, 0, 1] = [0.0, 0.0, 1.0]
    surface = ProductSurface(side, PowerBasis([0.0, 1.0], 1), coefficients, smoothness=math.inf)
    with pytest.raises(InputError, match="does not close smoothly in theta_1"):
        sample_grid(surface)
