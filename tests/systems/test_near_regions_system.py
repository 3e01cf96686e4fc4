"""Nearest regions of a schedule, as a system: against all distances at every tick."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from pfsc_drake.control.fixtures.contact_program import MOST_NEAR
from pfsc_drake.control.fixtures.fixture_guidance import NEAR_COLUMNS
from pfsc_drake.control.fixtures.fixture_parameters import GuidanceParameters
from pfsc_drake.control.fixtures.near_regions import NOTHING, ScheduledRegions, near_rows, reaches
from pfsc_drake.geometry.regions.moving import ShiftedRegion
from pfsc_drake.geometry.shapes.sphere import SphereRegion
from pfsc_drake.systems.near_regions_system import NearRegions
from tests.control.fixtures.walks import Swinging

PERIOD, PARAMETERS = 1e-3, GuidanceParameters()
COUNT, MOVING, SPEED = 30, 5, 0.03


def point_at(k):
    angle = 2e-3 * k
    return np.array([0.3 * np.sin(angle), 0.3 * (1.0 - np.cos(angle)), 0.1 * np.sin(3.0 * angle)])


@pytest.fixture(scope="module")
def regions():
    """Balls beside the way, 5 mm to 50 mm from it; some swing."""
    random = np.random.default_rng(3)
    balls = []
    for k in np.linspace(0, 400, COUNT):
        across = random.normal(size=3)
        away = 0.02 + random.uniform(0.005, 0.05)
        centre = point_at(k) + away * across / np.linalg.norm(across)
        balls.append(SphereRegion(centre, 0.02, inside=False))
    for i in range(0, 2 * MOVING, 2):
        balls[i] = ShiftedRegion(balls[i], Swinging(0.01, SPEED / 0.01), random.normal(size=3))
    return balls


def speeds(regions):
    return [SPEED * isinstance(region, ShiftedRegion) for region in regions]


class Bench:
    """A point that is carried along a way among the regions."""

    def __init__(self, regions):
        scheduled = ScheduledRegions(regions, PARAMETERS, PERIOD, speeds=speeds(regions))
        self.system = NearRegions(scheduled, len(regions), PERIOD)
        self.simulator = Simulator(self.system)
        self.context = self.simulator.get_mutable_context()
        self.tick = 0

    def look(self, z):
        """Return rows, limit, and which regions were evaluated at the next tick."""
        clock = self.tick * PERIOD
        values = [*z, clock, clock + PERIOD]
        self.system.GetInputPort("evaluation_point").FixValue(self.context, np.array(values))
        self.simulator.AdvanceTo(clock)
        near = self.system.GetOutputPort("near").Eval(self.context).copy()
        self.simulator.AdvanceTo(clock + PERIOD / 2.0)
        self.tick += 1
        rows = near[: NEAR_COLUMNS * MOST_NEAR].reshape(MOST_NEAR, NEAR_COLUMNS)
        return rows, near[NEAR_COLUMNS * MOST_NEAR], near[NEAR_COLUMNS * MOST_NEAR + 1 :]


@pytest.mark.slow
def test_it_finds_what_all_distances_find_and_evaluates_few(regions):
    bench = Bench(regions)
    every = near_rows(regions, reaches(PARAMETERS, PERIOD, speeds(regions)))
    evaluated, found = 0, 0
    for k in range(400):
        rows, limit, looked_at = bench.look(point_at(k))
        expected = every(point_at(k), k * PERIOD, (k + 1) * PERIOD).full()
        np.testing.assert_allclose(rows, expected, atol=1e-12)
        assert limit == np.inf
        evaluated, found = evaluated + looked_at.sum(), found + np.sum(rows[:, 0] >= 0.0)
    assert found > 100
    assert evaluated < 3 * 400


def test_regions_that_are_off_are_not_reported(regions):
    bench = Bench(regions)
    on = np.ones(len(regions))
    bench.system.GetInputPort("active").FixValue(bench.context, on)
    near = next(
        (z, rows[0, 0])
        for z in map(point_at, range(400))
        if (rows := bench.look(z)[0])[0, 0] >= 0.0
    )
    on[int(near[1])] = 0.0
    bench.system.GetInputPort("active").FixValue(bench.context, on)
    assert near[1] not in bench.look(near[0])[0][:, 0]


def test_a_position_that_is_not_finite_is_near_nothing(regions):
    bench = Bench(regions)
    for k in range(5):
        bench.look(point_at(k))
    before = bench.context.get_discrete_state_vector().value().copy()
    rows, limit, looked_at = bench.look([np.nan, 0.0, 0.0])
    assert np.all(rows[:, 0] == NOTHING)
    assert limit == 0.0
    assert not looked_at.any()
    np.testing.assert_array_equal(bench.context.get_discrete_state_vector().value(), before)
