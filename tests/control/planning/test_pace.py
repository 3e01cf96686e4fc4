"""The pace of a motion: as fast as asked where the drives can, and never more than they may."""

import numpy as np
import pytest

from pfsc_drake.control.planning.drive_demand import (
    Clock,
    DriveDemand,
    allowed_demand,
    find_pace,
    with_pace,
)
from pfsc_drake.errors import InputError

STEP = 1e-3
TIMES = np.arange(0.0, 1.5, STEP)


def bump(size, width):
    """Return a motion of three joints that turns sharply at 0.7 s, and its derivatives 0..4."""
    x = np.polynomial.hermite_e.HermiteE
    u = (TIMES - 0.7) / width
    bell = np.exp(-(u**2) / 2.0)
    orders = [(-1.0) ** k * x.basis(k)(u) * bell / width**k for k in range(5)]
    share = np.array([1.0, -0.7, 0.4])
    course = size * np.einsum("ks,n->skn", np.array(orders), share)
    course[:, 0] += [0.2, 1.2, -0.5]
    course[:, 1] += 0.2 * share
    course[:, 0] += 0.2 * np.multiply.outer(TIMES, share)
    return course


@pytest.fixture(name="demand")
def fixture_demand(load_robot):
    return DriveDemand(load_robot("comau_racer_1_4_elastic_3r").chain, "elastic")


def pace_of(demand, course, limits, reserve=0.3):
    still = demand.of(with_pace(course, np.zeros((len(course), 4))))
    allowed = allowed_demand(still, limits, reserve)
    return find_pace(demand, course, STEP, allowed, 5.0, 0.04), allowed


@pytest.mark.parametrize("seed", range(8))
def test_what_is_asked_is_allowed(seed, demand, load_robot):
    """Whatever the turn: the demand of the slowed motion by differences of its own in time."""
    rng = np.random.default_rng(seed)
    course = bump(rng.uniform(0.02, 0.2), rng.uniform(0.03, 0.1))
    chain = load_robot("comau_racer_1_4_elastic_3r").chain
    limits = np.concatenate([chain.gather("effort_limit"), chain.gather("velocity_limit")])
    pace, allowed = pace_of(demand, course, limits)
    assert np.all(pace.rates[:, 0] <= 1.0) and np.all(pace.rates[:, 0] > 0.0)
    assert np.all(np.abs(demand.of(with_pace(course, pace.rates))) <= allowed)
    clock = Clock(pace.rates[:, 0], STEP)
    times = clock.times
    assert np.allclose(clock.tau(times), TIMES, rtol=0, atol=1e-12)
    # d/dt of the pace is what its derivatives say
    for k in range(3):
        slope = np.gradient(pace.rates[:, k], times)
        scale = np.abs(pace.rates[:, k + 1]).max() + 1e-9
        assert np.abs(slope - pace.rates[:, k + 1])[10:-10].max() < 0.05 * scale
    # far from the turn it is as fast as asked, as far as changes of 5 1/s let it
    if pace.rates[:, 0].min() > 0.6:
        assert pace.rates[0, 0] == pytest.approx(1.0) and pace.rates[-1, 0] == pytest.approx(1.0)


def test_what_fits_is_not_slowed(demand):
    course = bump(0.01, 0.1)
    pace = pace_of(demand, course, np.full(6, 1e5))[0]
    assert np.all(pace.rates[:, 0] == 1.0) and not pace.rates[:, 1:].any()
    assert Clock(pace.rates[:, 0], STEP).end == pytest.approx(TIMES[-1], rel=1e-12)


def test_a_slower_motion_is_not_asked_for_more_slowly_than_needed(demand):
    """Where the pace is even, the tightest drive takes what it may, but for a tenth."""
    course = bump(0.2, 0.05)
    still = demand.of(with_pace(course, np.zeros((len(course), 4))))
    asked = np.abs(demand.of(course)).max(axis=0)
    limits = np.maximum(0.5 * asked / 0.7, 3.0 * np.abs(still).max(axis=0) + 1.0)
    pace = pace_of(demand, course, limits)[0]
    assert pace.rates[:, 0].min() < 0.95
    assert pace.share.max() > 0.8


def test_beside_a_weight_that_takes_all_that_is_allowed_some_of_the_rest_is():
    limits = np.array([10.0, 10.0, 10.0, np.inf])
    weights = np.array([[2.0, 8.0, 12.0, 1.0]])
    allowed = allowed_demand(weights, limits, 0.3)
    assert np.allclose(allowed[0, :3], [7.0, 8.7, 10.0]) and np.isinf(allowed[0, 3])


def test_weight_beyond_the_drives_is_said(demand):
    course = bump(0.1, 0.1)
    with pytest.raises(InputError, match="no pace"):
        pace_of(demand, course, np.full(6, 1.0))
