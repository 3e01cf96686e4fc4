"""Courses of moving regions: values beyond their ends, repetition, largest rates."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.geometry.regions.moving import CurveMotion


def evaluated(motion):
    """Values over the clock."""
    clock = ca.MX.sym("clock")
    value = ca.Function("at", [clock], [motion.at(clock)])
    return lambda time: float(value(time))


def _there_and_back(last=0.0):
    return rest_to_rest([0.0, 0.1, last], velocity=0.2, acceleration=1.0, dwell=0.3)


def test_it_rests_before_and_after():
    curve = _there_and_back(0.02)
    at = evaluated(CurveMotion(curve))
    assert at(-1.0) == 0.0
    assert at(curve.domain[1] + 5.0) == pytest.approx(0.02, abs=1e-15)
    for clock in np.linspace(*curve.domain, 30):
        assert at(clock) == pytest.approx(curve.derivatives(clock, 0)[0, 0], abs=1e-15)


def test_it_repeats():
    curve = _there_and_back()
    at = evaluated(CurveMotion(curve, repeat=True))
    for clock in np.linspace(*curve.domain, 30):
        for revolutions in (-2.0, 3.0):
            assert at(clock + revolutions * curve.period) == pytest.approx(at(clock), abs=1e-12)


@pytest.mark.parametrize("velocity", [0.2, 10.0])
def test_its_largest_rate_is_that_of_samples(velocity):
    """Also where the fullest speed is that of two ramps, between samples."""
    curve = rest_to_rest([0.0, 0.1, -0.3], velocity=velocity, acceleration=1.0)
    motion = CurveMotion(curve)
    rates = np.abs(curve.derivatives(np.linspace(*curve.domain, 20001), 1)[:, 1, 0])
    assert rates.max() <= motion.largest_rate * (1.0 + 1e-12)
    assert motion.largest_rate == pytest.approx(rates.max(), rel=1e-6)


def test_its_largest_rate_within_a_piece():
    """Of 10 u^3 - 15 u^4 + 6 u^5: 15 / 8 in the middle."""
    curve = PiecewisePolynomialCurve(
        [0.0, 1.0], [[[0.0], [0.0], [0.0], [10.0], [-15.0], [6.0]]], known_smoothness=5
    )
    assert CurveMotion(curve).largest_rate == pytest.approx(15.0 / 8.0)


def test_invalid_motions():
    with pytest.raises(InputError, match=r"begins at 0 and ends at 0\.02; both must be the same"):
        CurveMotion(_there_and_back(0.02), repeat=True)
    with pytest.raises(InputError, match="dimension 2"):
        CurveMotion(PiecewisePolynomialCurve.line((0.0, 0.0), (1.0, 0.0)))
    with pytest.raises(InputError, match="must be at rest there"):
        CurveMotion(PiecewisePolynomialCurve.line([0.0], [1.0]))
