"""Speed scaling: the requested speed where the drives allow it, and never beyond their limits."""

import numpy as np
import pytest

from pfsc_drake.control.planning.drive_demand import (
    Clock,
    DriveDemand,
    allowed_demand,
    apply_scaling,
    find_scaling,
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
    trajectory = size * np.einsum("ks,n->skn", np.array(orders), share)
    trajectory[:, 0] += [0.2, 1.2, -0.5]
    trajectory[:, 1] += 0.2 * share
    trajectory[:, 0] += 0.2 * np.multiply.outer(TIMES, share)
    return trajectory


@pytest.fixture(name="demand")
def fixture_demand(load_robot):
    return DriveDemand(load_robot("comau_racer_1_4_elastic_3r").chain, "elastic")


def scaling_of(demand, trajectory, limits, reserve=0.3):
    still = demand.of(apply_scaling(trajectory, np.zeros((len(trajectory), 4))))
    allowed = allowed_demand(still, limits, reserve)
    return find_scaling(demand, trajectory, STEP, allowed, 5.0, 0.04), allowed


@pytest.mark.parametrize("seed", range(8))
def test_demand_is_within_the_limits(seed, demand, load_robot):
    """For any turn: the demand of the scaled motion, its derivatives checked by differences."""
    rng = np.random.default_rng(seed)
    trajectory = bump(rng.uniform(0.02, 0.2), rng.uniform(0.03, 0.1))
    chain = load_robot("comau_racer_1_4_elastic_3r").chain
    limits = np.concatenate([chain.gather("effort_limit"), chain.gather("velocity_limit")])
    scaling, allowed = scaling_of(demand, trajectory, limits)
    assert np.all(scaling.rates[:, 0] <= 1.0) and np.all(scaling.rates[:, 0] > 0.0)
    assert np.all(np.abs(demand.of(apply_scaling(trajectory, scaling.rates))) <= allowed)
    clock = Clock(scaling.rates[:, 0], STEP)
    times = clock.times
    assert np.allclose(clock.tau(times), TIMES, rtol=0, atol=1e-12)
    # the derivatives are those of the scaling
    for k in range(3):
        slope = np.gradient(scaling.rates[:, k], times)
        scale = np.abs(scaling.rates[:, k + 1]).max() + 1e-9
        assert np.abs(slope - scaling.rates[:, k + 1])[10:-10].max() < 0.05 * scale
    # far from the turn it has the requested speed, as far as changes of 5 1/s allow
    if scaling.rates[:, 0].min() > 0.6:
        assert scaling.rates[0, 0] == pytest.approx(1.0) and scaling.rates[-1, 0] == pytest.approx(
            1.0
        )


def test_motion_within_the_limits_is_not_slowed(demand):
    trajectory = bump(0.01, 0.1)
    scaling = scaling_of(demand, trajectory, np.full(6, 1e5))[0]
    assert np.all(scaling.rates[:, 0] == 1.0) and not scaling.rates[:, 1:].any()
    assert Clock(scaling.rates[:, 0], STEP).end == pytest.approx(TIMES[-1], rel=1e-12)


def test_motion_is_not_slowed_more_than_needed(demand):
    """At constant scaling the most loaded drive uses its limit, less a tenth."""
    trajectory = bump(0.2, 0.05)
    still = demand.of(apply_scaling(trajectory, np.zeros((len(trajectory), 4))))
    requested = np.abs(demand.of(trajectory)).max(axis=0)
    limits = np.maximum(0.5 * requested / 0.7, 3.0 * np.abs(still).max(axis=0) + 1.0)
    scaling = scaling_of(demand, trajectory, limits)[0]
    assert scaling.rates[:, 0].min() < 0.95
    assert scaling.share.max() > 0.8


def test_part_of_the_rest_is_allowed_where_gravity_takes_all():
    limits = np.array([10.0, 10.0, 10.0, np.inf])
    weights = np.array([[2.0, 8.0, 12.0, 1.0]])
    allowed = allowed_demand(weights, limits, 0.3)
    assert np.allclose(allowed[0, :3], [7.0, 8.7, 10.0]) and np.isinf(allowed[0, 3])


def test_gravity_beyond_the_drives_is_an_error(demand):
    trajectory = bump(0.1, 0.1)
    with pytest.raises(InputError, match="no speed scaling"):
        scaling_of(demand, trajectory, np.full(6, 1.0))
