"""What all curves share: domain, wrapping, scalar and vectorized evaluation."""

import math

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import FourierCurve, PiecewisePolynomialCurve
from pfsc_drake.geometry.curves.curve import check_order


def test_wrap_moves_by_whole_periods_and_keeps_the_ends() -> None:
    square = PiecewisePolynomialCurve(
        [1.0, 3.0], [[[0.0], [2.0], [-1.0]]], closed=True
    )  # u (2 - u): zero at both ends
    theta = np.array([1.0, 3.0, 3.5, 0.5, -4.5, 7.25])
    np.testing.assert_allclose(square.wrap(theta), [1.0, 3.0, 1.5, 2.5, 1.5, 1.25], rtol=1e-15)
    np.testing.assert_allclose(
        square.derivatives(theta, 0)[:, 0, 0], [0.0, 0.0, 0.75, 0.75, 0.75, 0.4375], atol=1e-14
    )


def test_wrap_leaves_open_curves_alone() -> None:
    assert PiecewisePolynomialCurve.line([0, 0], [1, 0]).wrap(5.0) == 5.0


def test_revolutions_are_whole_periods_out_of_the_domain() -> None:
    circle = FourierCurve.circle([0.0, 0.0, 0.0], 1.0)
    theta = np.array([-7.0, -0.1, 0.0, 3.0, 2.0 * math.pi, 6.3, 20.0])
    revolutions = circle.revolutions(theta)
    np.testing.assert_array_equal(revolutions, [-2, -1, 0, 0, 0, 1, 3])
    np.testing.assert_allclose(theta - revolutions * circle.period, circle.wrap(theta), atol=1e-14)
    assert PiecewisePolynomialCurve.line([0, 0], [1, 0]).revolutions(5.0) == 0.0


def test_open_curve_refuses_parameters_outside() -> None:
    line = PiecewisePolynomialCurve.line([0.0, 0.0, 0.0], [2.0, 0.0, 0.0])
    line.derivatives(2.0 + 1e-12, 1)
    with pytest.raises(InputError, match=r"theta: 2\.1; the curve is defined on \[0, 2\]"):
        line.derivatives([1.0, 2.1], 1)
    with pytest.raises(InputError, match="nan"):
        line.derivatives(math.nan, 1)


def test_vectorized_shapes(lemniscate: FourierCurve) -> None:
    assert lemniscate.derivatives(np.zeros((2, 5)), 3).shape == (2, 5, 4, 3)
    assert lemniscate.derivatives(0.3, 0).shape == (1, 3)


@pytest.mark.parametrize(
    ("breaks", "message"),
    [
        ([0.0, 1.0, 1.0], "breakpoints 1 and 2: 1 and 1"),
        ([0.0], "two or more"),
        ([0.0, math.nan], "finite"),
    ],
)
def test_breakpoints_are_checked(breaks: list[float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        PiecewisePolynomialCurve(breaks, np.ones((max(len(breaks) - 1, 1), 2, 1)))


@pytest.mark.parametrize("order", [-1, 1.5, True])
def test_order_is_checked(order: float) -> None:
    with pytest.raises(InputError, match="order of derivative"):
        check_order(order)  # type: ignore[arg-type]
