"""Polynomials of the drive demand against the demand itself."""

import numpy as np
import pytest

from pfsc_drake.control.planning.demand_polynomial import DemandPolynomial, exponents
from pfsc_drake.control.planning.drive_demand import DriveDemand, apply_scaling

LAWS = {"rigid": 4, "singular_perturbation": 7, "elastic": 12}


def trajectory(highest, samples=5):
    """Return any motion of three joints and its derivatives."""
    rng = np.random.default_rng(3)
    return (
        rng.uniform(-1.0, 1.0, (samples, highest + 1, 3)) * 5.0 ** np.arange(highest + 1)[:, None]
    )


@pytest.mark.parametrize("law", LAWS)
def test_torques_at_any_scaling(law, load_robot):
    """Exact up to rounding, far from the scalings that determined the coefficients."""
    chain = load_robot("comau_racer_1_4_elastic_3r").chain
    viscous, damping = np.array([3.0, 2.0, 1.0]), np.full(3, 0.004)
    demand = DriveDemand(chain, law, viscous, damping)
    motion = trajectory(demand.derivatives)
    polynomial = DemandPolynomial.of(demand, motion, 0.04)
    assert polynomial.coefficients.shape == (5, LAWS[law], 3)
    rates = np.random.default_rng(4).normal(size=(5, 4)) * [2.0, 60.0, 1e3, 1e5]
    expected = demand.of(apply_scaling(motion, rates))[:, :3]
    assert np.allclose(
        polynomial.torques(rates), expected, rtol=0, atol=1e-10 * np.abs(expected).max()
    )
    more = np.arange(15.0).reshape(5, 3)
    assert np.allclose(polynomial.plus(more).torques(rates), expected + more, rtol=1e-9)


def test_monomials_have_the_weight_of_derivatives():
    for highest, count in ((2, 4), (3, 7), (4, 12)):
        powers = exponents(highest)
        assert len(set(powers)) == len(powers) == count
        assert max(sum((k + 1) * p for k, p in enumerate(power)) for power in powers) == highest
