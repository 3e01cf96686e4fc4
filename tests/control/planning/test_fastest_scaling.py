"""Time-optimal scaling against closed forms of a mass that moves from rest to rest."""

import numpy as np
import pytest

from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.planning.demand_polynomial import DemandPolynomial, exponents
from pfsc_drake.control.planning.fastest_scaling import ScalingLimits, find_fastest_scaling
from pfsc_drake.control.planning.moves import straight_moves

DISTANCE, LARGEST = 0.7, 3.0
# by derivative of the motion: terms in the rates of the scaling
TERMS = {
    2: {(2, 0, 0, 0): (1.0, 2), (0, 1, 0, 0): (1.0, 1)},
    4: {
        (4, 0, 0, 0): (1.0, 4),
        (2, 1, 0, 0): (6.0, 3),
        (0, 2, 0, 0): (3.0, 2),
        (1, 0, 1, 0): (4.0, 2),
        (0, 0, 0, 1): (1.0, 1),
    },
}


def fastest(order, intervals, rate=np.inf, velocity=np.inf, watched=0.0, weight=0.0):
    """Return duration and extremes of a mass whose ``order``-th derivative is bounded."""
    motion = rest_to_rest([0.0, DISTANCE], velocity=10.0, acceleration=1.0)
    (move,) = straight_moves(motion, order + 1)
    for spacing in (0.5, 1.0):
        count = int(spacing * intervals)
        theta = np.linspace(0.0, move.duration, 4 * count + 1)
        derivatives = move.progress.derivatives(theta, order)[:, :, 0]
        table = np.zeros((len(theta), len(exponents(order)), 1))
        table[:, 0, 0] = weight
        for powers, (factor, k) in TERMS[order].items():
            table[:, exponents(order).index(powers), 0] = factor * derivatives[:, k]
        demand = DemandPolynomial(exponents(order), table)
        speed = np.maximum(derivatives[:, 1], 1e-9) / velocity
        ones = np.ones((len(theta), 1))
        limits = ScalingLimits(LARGEST * ones, rate * ones, 1.0 / np.maximum(speed, 1e-6))
        found = find_fastest_scaling(demand, theta, limits, count, order + 1, watched)
        assert found.converged, found.status
        # in much shorter pieces rounding destroys the fourth derivative
        move = move.with_scaling(found.scaling, order, found.scaling.duration / intervals)
    times = np.linspace(0.0, move.duration, 3000)
    return move.duration, np.abs(move.progress.derivatives(times, order + 1)[:, :, 0]).max(axis=0)


def test_torque_limit():
    """Half the distance accelerated, half braked: d = a T^2 / 4."""
    duration, largest = fastest(2, 80)
    least = 2.0 * np.sqrt(DISTANCE / LARGEST)
    assert least <= duration < 1.03 * least
    assert largest[2] < 1.01 * LARGEST


def test_torque_rate_limit():
    """D = j T^3 / 32; the torque limit is never reached."""
    rate = 6.0
    duration, largest = fastest(2, 60, rate=rate)
    least = (32.0 * DISTANCE / rate) ** (1.0 / 3.0)
    assert 0.999 * least <= duration < 1.03 * least
    assert largest[2] < LARGEST and largest[3] < 1.1 * rate


def test_torque_limit_of_an_elastic_drive():
    """Snap alone: the perfect spline at the zeros of a Chebyshev polynomial, d = s T^4 / 384."""
    duration, largest = fastest(4, 100)
    least = (384.0 * DISTANCE / LARGEST) ** 0.25
    assert least <= duration < 1.04 * least
    assert largest[4] < 1.02 * LARGEST


def test_velocity_limit():
    """Ramps at the largest torque and a cruise: T = d / v + v / a."""
    velocity = 0.6
    duration, largest = fastest(2, 80, velocity=velocity)
    least = DISTANCE / velocity + velocity / LARGEST
    assert least <= duration < 1.03 * least
    assert largest[1] < 1.001 * velocity


def test_gravity_leaves_less_torque_in_one_direction():
    """With w: accelerations a - w and a + w, T = sqrt(2 d (1 / (a - w) + 1 / (a + w)))."""
    weight = 1.0
    duration, _ = fastest(2, 80, weight=weight)
    least = np.sqrt(2.0 * DISTANCE * (1.0 / (LARGEST - weight) + 1.0 / (LARGEST + weight)))
    assert least <= duration < 1.03 * least


@pytest.mark.slow
def test_limits_that_are_left_out_first_are_met():
    whole, partly = (fastest(2, 60, rate=30.0, watched=watched) for watched in (0.0, 0.9))
    assert partly[0] == pytest.approx(whole[0], rel=1e-4)
    assert np.allclose(partly[1], whole[1], rtol=1e-2)
