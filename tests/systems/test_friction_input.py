"""Friction compensation: on the drives, within their limits, while nothing is wrong."""

import numpy as np
import pytest

from pfsc_drake.control.law.fault import Fault
from pfsc_drake.systems.following_controller import FollowingController

PERIOD, THETA = 1e-3, 0.6
FRICTION = np.array([30.0, -45.0, 12.0])


class Bench:
    """A controller beside the path."""

    def __init__(self, arm, path, law):
        self.law, self.system = law, FollowingController(law, PERIOD)
        self.context = self.system.CreateDefaultContext()
        sigma = path.position.derivatives(THETA, 0)[0]
        q = arm.reach(sigma + np.array([0.004, -0.006, 0.005]))
        self.state = np.concatenate([q, [0.1, -0.2, 0.15]] * 2)
        point = path.evaluator(2)(arm.pose(q)[:3].tolist(), THETA)
        self.fix("joint_state", self.state)
        self.fix("manifold_point", point)
        self.fix("reference", np.concatenate([[point[1] + 0.01], np.zeros(8)]))

    def fix(self, port, value):
        self.system.GetInputPort(port).FixValue(self.context, value)

    def output(self, name):
        return self.system.GetOutputPort(name).Eval(self.context).copy()


@pytest.fixture(name="bench")
def fixture_bench(arm, path, make_law):
    return Bench(arm, path, make_law())


def test_it_adds_to_the_drive_torques_and_to_nothing_else(bench):
    before = bench.output("law")
    bench.fix("friction_torque", FRICTION)
    change = bench.output("law") - before
    np.testing.assert_allclose(change[bench.law.layout.drive], FRICTION, rtol=0, atol=1e-11)
    change[bench.law.layout.drive] = 0.0
    assert not change.any()


def test_what_it_asks_beyond_the_limits_is_saturation(bench):
    free = bench.output("drive_torque")
    limit = bench.law.limits
    bench.fix("friction_torque", np.where([0, 1, 0], np.sign(free) * limit, 0.0))
    assert bench.output("status")[2] == 1.0
    assert abs(bench.output("drive_torque")[1]) == limit[1]


def test_it_is_not_added_in_the_safe_state(bench):
    state = bench.state.copy()
    state[1] = np.nan
    bench.fix("joint_state", state)
    bench.fix("friction_torque", np.zeros(3))
    without = bench.output("drive_torque")
    bench.fix("friction_torque", FRICTION)
    assert np.array_equal(bench.output("drive_torque"), without)


def test_friction_that_is_not_finite_is_a_fault(bench):
    bench.fix("friction_torque", np.array([0.0, np.nan, 0.0]))
    assert bench.output("fault") == Fault.INPUT_NOT_FINITE


def test_servos_overcome_friction_themselves(make_law):
    assert not FollowingController(make_law(law="velocity_servo"), PERIOD).HasInputPort(
        "friction_torque"
    )
