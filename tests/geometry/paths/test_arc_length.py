"""Arc length against adaptive quadrature."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import ArcLength, FourierCurve, PiecewisePolynomialCurve, interpolate
from pfsc_drake.geometry.curves.curve import Curve


def _by_quadrature(curve: Curve, begin: float, end: float) -> float:
    inner = [b for b in curve.breakpoints if begin < b < end]
    total = 0.0
    for a, b in zip([begin, *inner], [*inner, end], strict=True):
        total += quad(
            lambda t: float(np.linalg.norm(curve.derivatives(t, 1)[1])),
            a,
            b,
            epsabs=1e-13,
            epsrel=1e-13,
            limit=200,
        )[0]
    return total


@pytest.fixture(params=["lemniscate", "twisted", "bumps", "open_spline"])
def curve(request: pytest.FixtureRequest) -> Curve:
    return request.getfixturevalue(request.param)


@pytest.mark.slow(but=["bumps", "lemniscate"])
def test_agrees_with_quadrature(curve: Curve) -> None:
    s = ArcLength(curve)
    begin, end = curve.domain
    assert s.length == pytest.approx(_by_quadrature(curve, begin, end), abs=1e-11)
    for theta in np.random.default_rng(0).uniform(begin, end, 8).tolist():
        assert s(theta) == pytest.approx(_by_quadrature(curve, begin, theta), abs=1e-11)
    assert s(begin) == 0.0
    assert s(end) == pytest.approx(s.length, abs=1e-14)


def test_round_trip(curve: Curve) -> None:
    s = ArcLength(curve)
    begin, end = curve.domain
    for theta in np.linspace(begin, end, 97).tolist():
        assert s.parameter(s(theta)) == pytest.approx(theta, abs=1e-10)
    for eta in np.linspace(0.0, s.length, 97).tolist():
        assert s(s.parameter(eta)) == pytest.approx(eta, abs=1e-10)


@pytest.fixture(scope="module")
def twisted_length(twisted: FourierCurve) -> ArcLength:
    return ArcLength(twisted)


@given(theta=st.floats(-50.0, 50.0))
@settings(max_examples=60, deadline=None)
def test_revolutions(twisted_length: ArcLength, theta: float) -> None:
    s = twisted_length
    assert s(theta + 2 * math.pi) - s(theta) == pytest.approx(s.length, abs=1e-12)
    assert s.parameter(s(theta)) == pytest.approx(theta, abs=1e-10)


def test_before_the_begin_is_negative(lemniscate: FourierCurve) -> None:
    s = ArcLength(lemniscate)
    expected = -_by_quadrature(lemniscate, 2 * math.pi - 0.5, 2 * math.pi)
    assert s(-0.5) == pytest.approx(expected, abs=1e-11)


def test_circle_and_arrays() -> None:
    s = ArcLength(FourierCurve.circle([0, 0, 0], 0.15))
    assert s.length == pytest.approx(0.3 * math.pi, abs=1e-14)
    theta = np.array([[0.1, 7.0], [-1.0, 3.0]])
    np.testing.assert_allclose(s(theta), 0.15 * theta, atol=1e-13)


def test_arrays_agree_with_single_values(curve: Curve) -> None:
    s = ArcLength(curve)
    begin, end = curve.domain
    theta = np.linspace(begin - 1.3 * curve.period, end + 2.4 * curve.period, 97)
    theta = np.append(theta, [begin, end]).reshape(3, 33)
    expected = [[s(value) for value in row] for row in theta.tolist()]
    np.testing.assert_allclose(s(theta), expected, rtol=1e-14, atol=1e-14)


def test_nearly_a_cusp() -> None:
    # |sigma'| falls to 1e-3 of its mean within a short stretch.
    theta = np.array([0.0, 2.0])
    curve = PiecewisePolynomialCurve(
        theta, [[[1 / 3, -0.5, 0.0], [1.0, 1.0, 1e-3], [-1.0, -0.5, 0.0], [1 / 3, 0.0, 0.0]]]
    )
    s = ArcLength(curve)
    exact = quad(
        lambda t: math.sqrt((t - 1) ** 4 + (t - 1) ** 2 + 1e-6), 0, 2, points=[1.0], epsabs=1e-13
    )[0]
    assert s.length == pytest.approx(exact, abs=1e-10)
    for eta in np.linspace(0, s.length, 50):
        assert s(s.parameter(float(eta))) == pytest.approx(eta, abs=1e-10)


def test_wild_spline() -> None:
    rng = np.random.default_rng(0)
    points = np.cumsum(0.1 * rng.normal(size=(20, 3)) + [0.1, 0, 0], axis=0)
    curve = interpolate(points, smoothness=6)
    s = ArcLength(curve)
    assert s.length == pytest.approx(_by_quadrature(curve, *curve.domain), abs=1e-10)


def test_open_ends() -> None:
    s = ArcLength(PiecewisePolynomialCurve.line([0, 0, 0], [0, 0, 2.0]))
    assert s(-1.0) == 0.0
    assert s(3.0) == pytest.approx(2.0, abs=1e-15)
    assert s.parameter(2.0 + 1e-10) == pytest.approx(2.0)
    with pytest.raises(InputError, match=r"arc length: 2\.1 m; the open path has \[0, 2\] m"):
        s.parameter(2.1)
    with pytest.raises(InputError, match="nan"):
        s.parameter(math.nan)


def test_a_point_has_no_length() -> None:
    with pytest.raises(InputError, match="length 0 m"):
        ArcLength(PiecewisePolynomialCurve([0, 1], [[[1.0, 2.0, 3.0]]]))
