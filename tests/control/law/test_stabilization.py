"""Gains and the linear control law."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pfsc_drake.control.law.stabilization import (
    CoordinateGains,
    Stabilization,
    check_gains,
    gains_from_poles,
)
from pfsc_drake.errors import InputError


def test_four_equal_poles_are_table_3_3():
    gains = gains_from_poles([-50.0] * 4)
    assert gains.proportional == pytest.approx((6250000.0, 500000.0, 15000.0, 200.0), rel=1e-12)
    assert gains.integral == 0.0


def test_two_equal_poles_are_table_3_4():
    assert gains_from_poles([-30.0, -30.0]).proportional == pytest.approx((900.0, 60.0))


def test_conjugate_poles():
    gains = gains_from_poles([-3 + 4j, -3 - 4j, -2])
    # (s^2 + 6 s + 25) (s + 2)
    assert gains.proportional == pytest.approx((50.0, 37.0, 8.0))
    assert sorted(gains.poles, key=lambda p: p.imag) == pytest.approx([-3 - 4j, -2, -3 + 4j])


def test_complex_poles_without_partner_are_refused():
    with pytest.raises(InputError, match="conjugate pairs"):
        gains_from_poles([-3 + 4j, -3 - 4.1j])


@given(st.lists(st.floats(-80.0, -0.5), min_size=1, max_size=5))
def test_poles_are_where_they_were_asked_for(poles):
    polynomial = gains_from_poles(poles).polynomial
    for pole in poles:
        scale = np.polyval(np.abs(polynomial), abs(pole))
        assert abs(np.polyval(polynomial, pole)) < 1e-12 * scale


@pytest.mark.parametrize(
    ("proportional", "integral"),
    [
        ((-1.0, 2.0), 0.0),
        ((1.0, -0.1), 0.0),
        ((0.0, 2.0), 0.0),
        ((4.0, 0.0), 0.0),
        ((1.0, 1.0, 0.5), 0.0),
        # s^3 + a_2 s^2 + a_1 s + a_0 needs a_1 a_2 > a_0
        ((10.0, 2.0), 20.1),
        ((10.0, 2.0), -0.1),
    ],
)
def test_gains_that_are_not_hurwitz_are_refused(proportional, integral):
    gains = CoordinateGains(proportional, integral)
    with pytest.raises(InputError, match=r"gains of eta.*not Hurwitz.*negative real parts"):
        check_gains(gains, len(proportional), "gains of eta")


def test_integral_part_up_to_the_stability_limit_is_accepted():
    """The dissertation's gains with integral part, Sec. 3.8.1, have a triple pole at -35."""
    check_gains(CoordinateGains((10.0, 2.0), 19.9), 2, "gains")
    gains = CoordinateGains((3675.0, 105.0), 42875.0)
    check_gains(gains, 2, "gains")
    assert gains.poles == pytest.approx([-35.0] * 3, rel=1e-4)


@pytest.mark.parametrize("proportional", [(1.0,), (1.0, 3.0, 3.0)])
def test_a_wrong_number_of_gains_is_refused(proportional):
    with pytest.raises(InputError, match=rf"phi: {len(proportional)} gains.*degree 2 needs 2"):
        check_gains(CoordinateGains(proportional), 2, "phi")


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_gains_must_be_finite(bad):
    for gains in (CoordinateGains((bad, 1.0)), CoordinateGains((1.0, 1.0), bad)):
        with pytest.raises(InputError, match="finite"):
            check_gains(gains, 2, "gains")


def test_stabilization_names_the_coordinate_at_fault():
    good, bad = CoordinateGains((1.0, 2.0)), CoordinateGains((1.0, -2.0))
    with pytest.raises(InputError, match="gains of xi_1"):
        Stabilization([good, bad, good], 2, ["eta", "xi_1", "xi_2"])


def test_virtual_input_is_the_printed_law():
    """(3.33) with (3.86), written out for two coordinates with gains of their own."""
    gains = [CoordinateGains((3.0, 5.0), 7.0), CoordinateGains((2.0, 4.0))]
    stabilization = Stabilization(gains, 2, ["eta", "xi_1"])
    Y = np.array([[0.1, 0.2], [0.3, 0.4]])
    reference = np.array([[0.01, 0.02], [0.03, 0.04], [0.05, 0.06]])
    integral = np.array([0.5, 0.6])
    v = stabilization.virtual_input(Y, reference, integral)
    assert v == pytest.approx(
        [
            0.05 - 5.0 * (0.3 - 0.03) - 3.0 * (0.1 - 0.01) - 7.0 * 0.5,
            0.06 - 4.0 * (0.4 - 0.04) - 2.0 * (0.2 - 0.02),
        ],
        abs=1e-15,
    )
    assert stabilization.has_integral_part
    assert not Stabilization(gains[1:], 2, ["xi_1"]).has_integral_part


def test_an_integral_part_has_a_pole_of_its_own():
    gains = gains_from_poles([-60, -60, -250, -350], integral_pole=-15.0)
    check_gains(gains, 4, "here")
    assert len(gains.proportional) == 4
    np.testing.assert_allclose(np.sort(gains.poles.real), [-350, -250, -60, -60, -15], rtol=1e-5)
    assert gains_from_poles([-60, -250]).integral == 0.0


def test_a_free_coordinate_keeps_its_place_and_loses_its_velocity():
    """With r = 3 the velocity obeys s^2 + 5 s + 6, from any position."""
    gains = CoordinateGains((0.0, 6.0, 5.0), is_free=True)
    check_gains(gains, 3, "eta")
    assert sorted(gains.poles) == pytest.approx([-3.0, -2.0])
    law = Stabilization([gains], 3, ["eta"])
    v = law.virtual_input(
        [np.array([0.7]), np.array([0.1]), np.array([0.2])], [np.zeros(1)] * 4, np.zeros(1)
    )
    assert v == pytest.approx([-6.0 * 0.1 - 5.0 * 0.2])


@pytest.mark.parametrize(
    ("gains", "degree", "part"),
    [
        (CoordinateGains((0.0, 3.0), 1.0, is_free=True), 2, "a_0 = 1"),
        (CoordinateGains((2.0, 3.0), is_free=True), 2, "a_1 = 0"),
        (CoordinateGains((0.0,), is_free=True), 1, "relative degree 2 or more"),
        (CoordinateGains((0.0, 0.0), is_free=True), 2, "not Hurwitz"),
        (CoordinateGains((0.0, -1.0), is_free=True), 2, "not Hurwitz"),
    ],
)
def test_free_gains_that_do_not_suit_are_refused(gains, degree, part):
    with pytest.raises(InputError, match=part):
        check_gains(gains, degree, "eta")
