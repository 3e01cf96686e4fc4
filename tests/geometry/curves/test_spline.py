"""Splines: interpolation, class, seam, symmetry, convergence."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import interpolate

SMOOTHNESS = [2, 3, 4, 5, 6]


def _jumps(curve, order: int) -> np.ndarray:
    """Jump of each derivative at interior breakpoints, by one-sided Taylor sums."""
    h = np.diff(curve.breakpoints)
    c = curve.coefficients
    jumps = []
    for k in range(order + 1):
        powers = [math.perm(j, k) * h ** max(j - k, 0) for j in range(c.shape[1])]
        left = sum(p[:, None] * c[:, j] for j, p in enumerate(powers))
        right = math.factorial(k) * c[:, k]
        following = np.roll(right, -1, axis=0) if curve.closed else right[1:]
        jumps.append(np.abs(following - (left if curve.closed else left[:-1])).max())
    return np.array(jumps)


@pytest.mark.parametrize("smoothness", SMOOTHNESS)
@pytest.mark.parametrize("closed", [False, True])
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_interpolates_with_the_requested_class(smoothness: int, closed: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = np.arange(11) * 0.5
    points = np.stack([np.cos(angle), np.sin(angle), np.sin(2 * angle)], axis=1)
    points += 0.05 * rng.normal(size=points.shape)
    curve = interpolate(points, smoothness=smoothness, closed=closed)
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    theta = np.concatenate([[0.0], np.cumsum(chords)])
    np.testing.assert_allclose(curve.derivatives(theta, 0)[:, 0], points, atol=1e-9)
    assert curve.degree == smoothness + 1
    assert curve.smoothness == smoothness
    assert curve.closed is closed
    jumps, scale = _jumps(curve, smoothness + 1), 1.0
    for k in range(smoothness + 1):
        scale = max(np.abs(curve.derivatives(curve.breakpoints, k)[:, k]).max(), 1.0)
        assert jumps[k] < 1e-7 * scale, k
    assert jumps[-1] > 1e-6
    assert curve.first_discontinuity(smoothness + 1) in curve.breakpoints


@pytest.mark.parametrize("smoothness", SMOOTHNESS)
def test_open_spline_reproduces_polynomials(smoothness: int) -> None:
    rng = np.random.default_rng(smoothness)
    parameters = np.sort(rng.uniform(0.0, 2.0, 14))
    polynomial = np.polynomial.Polynomial(rng.normal(size=smoothness + 2))
    points = np.stack([polynomial(parameters), parameters], axis=1)
    curve = interpolate(points, smoothness=smoothness, parameters=parameters)
    theta = np.linspace(parameters[0], parameters[-1], 50)
    found = curve.derivatives(theta, 2)
    for k in range(3):
        np.testing.assert_allclose(found[:, k, 0], polynomial.deriv(k)(theta), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("smoothness", SMOOTHNESS)
def test_closed_spline_does_not_depend_on_the_start_of_its_period(smoothness: int) -> None:
    rng = np.random.default_rng(2)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 10))
    points = np.stack([np.cos(angle), np.sin(angle), 0.3 * np.cos(3 * angle)], axis=1)
    first = interpolate(points, smoothness=smoothness, closed=True)
    second = interpolate(np.roll(points, -4, axis=0), smoothness=smoothness, closed=True)
    shift = np.linalg.norm(np.diff(points[:5], axis=0), axis=1).sum()
    theta = np.linspace(0, first.period, 80)
    expected = first.derivatives(theta + shift, 1)
    np.testing.assert_allclose(second.derivatives(theta, 1), expected, atol=1e-8)


@pytest.mark.parametrize("smoothness", SMOOTHNESS)
def test_closed_spline_converges_to_the_circle(smoothness: int) -> None:
    errors = []
    for count in (12, 24):
        angle = 2 * np.pi * np.arange(count) / count
        points = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        curve = interpolate(points, smoothness=smoothness, closed=True)
        radius = np.linalg.norm(curve.derivatives(np.linspace(0, 6, 500), 0)[:, 0], axis=1)
        errors.append(np.abs(radius - 1.0).max())
    order = math.log2(errors[0] / errors[1])
    assert order > smoothness + 1.5, (errors, order)


def test_repeated_last_waypoint_makes_no_difference() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0.2], [1, 1, 0], [0, 1.2, 0.0]], dtype=float)
    one = interpolate(points, smoothness=3, closed=True)
    two = interpolate(np.vstack([points, points[0]]), smoothness=3, closed=True)
    np.testing.assert_allclose(one.breakpoints, two.breakpoints)
    np.testing.assert_allclose(one.coefficients, two.coefficients)


def test_parametrizations() -> None:
    x = np.array([0.0, 1.0, 5.0, 5.25, 6.25, 8.25, 9.0])
    points = np.stack([x, 0 * x], axis=1)
    chord = interpolate(points, smoothness=3)
    np.testing.assert_allclose(chord.domain, (0.0, 9.0))
    np.testing.assert_allclose(chord.derivatives(x, 1)[:, 1, 0], 1.0, atol=1e-9)
    centripetal = interpolate(points, smoothness=3, parametrization="centripetal")
    assert centripetal.domain[1] == pytest.approx(9.0)
    steps = np.sqrt(np.diff(x))
    theta = np.concatenate([[0], np.cumsum(steps)]) * 9.0 / steps.sum()
    np.testing.assert_allclose(centripetal.derivatives(theta, 0)[:, 0, 0], x, atol=1e-10)


def test_errors() -> None:
    x = np.arange(9.0)
    points = np.stack([x, x**2], axis=1)
    with pytest.raises(InputError, match=r"4 and 5 coincide"):
        interpolate(points[[0, 1, 2, 3, 3, 4, 5]], smoothness=2)
    with pytest.raises(InputError, match="6 distinct for an open curve of class C\\^5; at least 7"):
        interpolate(points[:6], smoothness=5)
    with pytest.raises(
        InputError, match="2 distinct for a closed curve of class C\\^2; at least 3"
    ):
        interpolate(points[[0, 1, 0]], smoothness=2, closed=True)
    broken = points.copy()
    broken[4, 1] = math.nan
    with pytest.raises(InputError, match="waypoint 5: "):
        interpolate(broken, smoothness=2)
    with pytest.raises(InputError, match="smoothness: 7"):
        interpolate(points, smoothness=7)
    with pytest.raises(InputError, match="'arc'; 'chord' or 'centripetal'"):
        interpolate(points, smoothness=2, parametrization="arc")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="parameters 2 and 3: 2 and 1"):
        interpolate(points, smoothness=2, parameters=[0, 2, 1, 3, 4, 5, 6, 7, 8])
    with pytest.raises(InputError, match=r"parameters: shape \(3,\)"):
        interpolate(points, smoothness=2, parameters=[0, 1, 2])
    with pytest.raises(InputError, match="waypoints: shape"):
        interpolate([1.0, 2.0], smoothness=2)


def test_a_large_closed_spline_is_the_same_curve() -> None:
    """Beyond a thousand waypoints its equations are sparse."""
    angle = 2.0 * np.pi * np.arange(1500) / 1500
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for smoothness in (3, 5):
        curve = interpolate(points, smoothness=smoothness, closed=True)
        theta = np.linspace(*curve.domain, 5000)
        turn = 2.0 * np.pi / curve.period * theta
        expected = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        np.testing.assert_allclose(curve.derivatives(theta, 0)[:, 0], expected, atol=1e-12)
