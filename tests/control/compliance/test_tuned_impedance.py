"""Parameters that change while a hand is on the tool."""

import math

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.compliance.impedance import DAMPING, STIFFNESS
from pfsc_drake.control.compliance.impedance_parameters import (
    CoordinateImpedance,
    ImpedanceParameters,
    Profile,
)
from pfsc_drake.control.compliance.tuned_impedance import (
    AS_GIVEN,
    ImpedanceTuner,
    TuningParameters,
)
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.errors import InputError
from tests.control.compliance.impedance_on_numbers import ImpedanceOnNumbers

PERIOD = 1e-3
COORDINATES = PathManifold(2, oriented=False).coordinates
NOTHING = np.full(6, AS_GIVEN)
REQUEST = {"along": slice(0, 2), "across": slice(2, 4)}


def impedance(mass, damping, stiffness):
    return CoordinateImpedance(Profile(mass), Profile(damping), Profile(stiffness))


SOFT = ImpedanceParameters(impedance(3.0, 90.0, 0.0), impedance(3.0, 30.0, 1000.0))
HARD = ImpedanceParameters(impedance(3.0, 90.0, 0.0))


class Bench:
    """A filter at rest on its manifold, a tuning, and a hand."""

    def __init__(self, parameters=SOFT, **options):
        self.law = ImpedanceOnNumbers(parameters, COORDINATES, 2, PERIOD)
        self.given = self.law.impedance(np.zeros(3))
        masses = np.full(3, 3.0)
        self.tuner = Stepper(
            ImpedanceTuner(TuningParameters(**options), self.law.law, COORDINATES, masses)
        )
        self.impedance = self.given
        self.state, self.work = self.law.start(np.zeros((2, 3))), 0.0
        self.request = NOTHING.copy()

    def tick(self, force=(0.0, 0.0, 0.0)):
        """Go on by a tick, and count the work of the hand."""
        before = self.state[0].copy()
        self.tune(self.state[:2])
        self.state, _ = self.law.update(
            self.state, np.zeros((3, 3)), np.asarray(force), self.impedance
        )
        self.work += float(np.dot(force, self.state[0] - before))

    def tune(self, error, y=(0.0, 0.0, 0.0)):
        """Let the request be followed for a tick."""
        self.impedance = self.tuner.step(
            request=self.request,
            manifold_state=[*y, 0.0, 0.0, 0.0],
            reference=[*np.ravel(error), 0.0, 0.0, 0.0],
            desired_reference=np.zeros(9),
        )["impedance"].reshape(3, 3)

    @property
    def tank(self):
        return self.tuner.states["tank"][0]

    def hold_at(self, position, ticks, strength=5e3):
        """Lead the second coordinate to a place, as a stiff hand does."""
        for _ in range(ticks):
            error, rate = position - self.state[0, 1], self.state[1, 1]
            self.tick((0.0, strength * error - 100.0 * rate, 0.0))

    @property
    def stored(self):
        mass, _, stiffness = self.state[3:]
        return 0.5 * float(mass @ self.state[1] ** 2 + stiffness @ self.state[0] ** 2)


def pump(bench, cycles):
    """Pull out while it is soft, stiffen at depth, be pulled back while it is stiff."""
    for _ in range(cycles):
        bench.request[REQUEST["across"]] = [0.0, 1.0]
        bench.hold_at(0.03, 400)
        bench.request[REQUEST["across"]] = [5000.0, 1.0]
        bench.hold_at(0.03, 400)
        bench.hold_at(0.0, 400)


@pytest.mark.slow
def test_nobody_can_pump_energy_out_of_it():
    bench = Bench(capacity=0.5, reserve=0.05)
    pump(bench, 10)
    assert bench.work >= bench.stored - 0.05 - 1e-9


@pytest.mark.slow
def test_without_the_tank_somebody_could():
    """Negative control of the test above."""
    bench = Bench(capacity=1e6, reserve=1e6)
    pump(bench, 10)
    assert bench.work < bench.stored - 2.0


def test_any_motion_is_passive():
    """Random pulls and requests, seeded; at every instant."""
    random = np.random.default_rng(7)
    for _ in range(5):
        bench = Bench(reserve=0.02)
        for _ in range(40):
            bench.request[:4] = random.uniform(0.0, [2000.0, 100.0, 6000.0, 100.0])
            force = random.normal(0.0, 20.0, 3)
            for _ in range(int(random.integers(10, 80))):
                bench.tick(force)
                assert bench.work >= bench.stored - 0.02 - 1e-9
                assert bench.tank >= 0.0


def test_what_is_credited_was_dissipated_also_where_a_hand_reverses():
    """Within a tick the rate may go through zero, and a damper then takes less than at its ends."""
    bench = Bench(reserve=0.0)
    bench.tune(np.zeros((2, 3)))
    credited = []
    for rate in (0.1, 0.08, -0.08, -0.1, 0.1):
        before = bench.tank
        bench.tune([[0.0, 0.0, 0.0], [0.0, rate, 0.0]])
        credited.append((bench.tank - before) / (PERIOD * 30.0))
    np.testing.assert_allclose(credited, [0.0, 0.08**2, 0.0, 0.08**2, 0.0], atol=1e-12)


def test_on_the_manifold_a_wish_is_followed_with_its_time_constant():
    bench = Bench(ramp=0.1, reserve=0.0)
    bench.request[REQUEST["across"]] = [5000.0, 150.0]
    for _ in range(200):
        bench.tick()
    left = math.exp(-200 * PERIOD / 0.1)
    assert bench.impedance[STIFFNESS, 1:] == pytest.approx(5000.0 - 4000.0 * left)
    assert bench.impedance[DAMPING, 1:] == pytest.approx(150.0 - 120.0 * left)
    assert bench.impedance[:, 0].tolist() == [3.0, 90.0, 0.0]


def test_at_depth_stiffness_waits_for_what_dampers_dissipate():
    bench = Bench(reserve=0.05)
    bench.request[REQUEST["across"]] = [0.0, 30.0]
    bench.hold_at(0.05, 1000)
    full = bench.tank
    bench.request[REQUEST["across"]] = [5000.0, 30.0]
    bench.hold_at(0.05, 3000)
    there = bench.state[0, 1]
    paid = 0.5 * bench.impedance[STIFFNESS, 1] * there**2
    assert paid < full + 0.01
    assert bench.impedance[STIFFNESS, 1] < 1000.0
    bench.hold_at(0.0, 2000)
    assert bench.impedance[STIFFNESS, 1] > 4900.0


def test_stiffness_falls_at_any_depth():
    bench = Bench(ramp=0.05)
    bench.hold_at(0.04, 500)
    bench.request[REQUEST["across"]] = [0.0, 30.0]
    bench.hold_at(0.04, 500)
    assert bench.impedance[STIFFNESS, 1] < 1.0


def test_what_is_rigid_becomes_soft_and_rigid_again_without_a_step():
    bench = Bench(HARD)
    assert np.isinf(bench.impedance[STIFFNESS, 1:]).all()
    bench.request[REQUEST["across"]] = [2000.0, 150.0]
    path = []
    for step in range(4000):
        if step == 2000:
            bench.request[:] = AS_GIVEN
        bench.tick((0.0, 20.0 if step < 2000 else 0.0, 0.0))
        path.append(bench.state[0, 1])
    assert path[1999] == pytest.approx(20.0 / 2000.0, rel=1e-3)
    assert np.isinf(bench.impedance[STIFFNESS, 1])
    assert path[-1] == 0.0
    rates = np.diff(path) / PERIOD
    assert np.abs(np.diff(path)).max() < 2e-4
    # of forces and springs, not of steps; when it is caught, what is left of the way
    assert np.abs(np.diff(rates)).max() < 1e-4 / PERIOD + 0.01


def test_a_wish_for_nothing_changes_nothing():
    bench = Bench()
    for _ in range(50):
        bench.tick((3.0, -2.0, 1.0))
    assert np.array_equal(bench.impedance, bench.given)


def test_parameters_that_vary_by_themselves_do_so_at_once():
    stiffness = Profile(over="eta", at=[0.0, 1.0], values=[100.0, 600.0])
    across = CoordinateImpedance(Profile(3.0), Profile(90.0), stiffness)
    bench = Bench(ImpedanceParameters(impedance(3.0, 90.0, 0.0), across))
    bench.request[1] = 30.0  # damping along
    bench.tune(np.zeros((2, 3)))
    assert bench.impedance[STIFFNESS].tolist() == [0.0, 100.0, 100.0]
    error = [[0.0, 0.1, 0.1], [0.0] * 3]
    bench.tune(error, y=[2.0, 0.1, 0.1])
    assert bench.impedance[STIFFNESS].tolist() == [0.0, 600.0, 600.0]
    assert np.array_equal(bench.impedance[DAMPING, 1:], [90.0, 90.0])
    assert 88.0 < bench.impedance[DAMPING, 0] < 90.0


def test_a_motion_that_is_not_finite_changes_nothing():
    bench = Bench()
    bench.request[REQUEST["across"]] = [3000.0, 90.0]
    bench.hold_at(0.01, 20)
    before, impedance_before = dict(bench.tuner.states), bench.impedance
    bench.tune(np.full((2, 3), np.nan))
    assert np.array_equal(bench.impedance, impedance_before)
    for name, value in before.items():
        assert np.array_equal(bench.tuner.states[name], value)


def test_numbers_out_of_range_are_refused():
    with pytest.raises(InputError, match=r"capacity = -1\.0"):
        TuningParameters(capacity=-1.0)
