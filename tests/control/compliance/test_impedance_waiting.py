"""The filter waits until all is ready, and goes on from rest without a step."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from pfsc_drake.control.compliance.impedance import ImpedanceLaw
from pfsc_drake.control.compliance.impedance_filter import ImpedanceFilter
from pfsc_drake.control.compliance.impedance_parameters import (
    CoordinateImpedance,
    ImpedanceParameters,
    Profile,
)
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.systems.block_system import BlockSystem

PERIOD = 1e-3
POSITION = PathManifold(2, oriented=False).coordinates
MASS, DAMPING, STIFFNESS = 0.3, 122.47, 500.0
DESIRED = np.array([0.5, 0.0, 0.0, 0.2, 0.0, 0.0, 0.1, 0.0, 0.0])
ACTUAL = np.array([0.48, 0.01, -0.02, 0.1, 0.03, 0.05])
FORCE = np.array([4.0, -6.0, 9.0])


class Bench:
    """A filter in a context with fixed inputs, of which ``ready`` is not."""

    def __init__(self, start):
        soft = CoordinateImpedance(Profile(MASS), Profile(DAMPING), Profile(STIFFNESS))
        law = ImpedanceLaw(ImpedanceParameters(soft, soft), POSITION, 2, PERIOD)
        self.system = BlockSystem(ImpedanceFilter(law, start=start), PERIOD)
        self.context = self.system.CreateDefaultContext()
        self.fix(desired_reference=DESIRED, manifold_force=FORCE, manifold_state=ACTUAL, ready=[0])
        self.simulator = Simulator(self.system, self.context)
        self.simulator.Initialize()

    def fix(self, **inputs):
        for name, value in inputs.items():
            self.system.GetInputPort(name).FixValue(self.context, value)

    def tick(self, count=1):
        ticks = round(self.context.get_time() / PERIOD) + count
        self.simulator.AdvanceTo(ticks * PERIOD)

    def rows(self):
        return self.system.GetOutputPort("reference").Eval(self.context).reshape(3, 3).copy()


@pytest.mark.parametrize(("start", "y_p"), [("actual", ACTUAL[:3]), ("reference", DESIRED[:3])])
def test_rests_where_it_started_until_ready(start, y_p):
    bench = Bench(start)
    for _ in range(5):
        assert np.array_equal(bench.rows(), [y_p, np.zeros(3), np.zeros(3)])
        bench.tick(10)
        # neither force nor external reference moves it
        bench.fix(desired_reference=bench.context.get_time() + DESIRED)


def test_goes_on_from_rest_as_the_impedance_does():
    bench = Bench("actual")
    bench.tick(20)
    bench.fix(ready=[1])
    before = bench.rows()[0]
    bench.tick(3)
    # the last update was the third that was ready: m e'' + d e' + k e = tau, integrated finely
    e, e_1 = before - DESIRED[:3], -DESIRED[3:6]
    y_d, y_d1, y_d2 = DESIRED.reshape(3, 3)
    steps = 20_000
    h = PERIOD / steps
    motion = np.array([before, np.zeros(3)])
    for _ in range(3):
        e, e_1 = motion - [y_d, y_d1]
        for _ in range(steps):
            e_1 = e_1 + h * (FORCE - DAMPING * e_1 - STIFFNESS * e) / MASS
            e = e + h * e_1
        # the external reference of this bench is the same in every tick
        ahead = [y_d + PERIOD * y_d1 + PERIOD**2 / 2 * y_d2, y_d1 + PERIOD * y_d2]
        motion = np.array([e, e_1]) + ahead
    np.testing.assert_allclose(bench.rows()[:2], motion, rtol=2e-4)


def test_once_it_moves_it_waits_no_more():
    bench = Bench("actual")
    bench.fix(ready=[1])
    bench.tick(5)
    moving = bench.rows()
    assert np.abs(moving[1]).max() > 1e-3
    bench.fix(ready=[0])
    bench.tick()
    assert np.abs(bench.rows()[0] - moving[0]).max() > 1e-6
