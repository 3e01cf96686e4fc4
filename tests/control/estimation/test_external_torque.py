"""External torques of a wrench on the tool, against Drake's Jacobian and known derivatives."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.estimation.external_forces import ExternalTorque
from pfsc_drake.errors import InputError

PERIOD = 1e-3
WRENCH = np.array([12.0, -7.0, 30.0, 1.5, -0.8, 0.6])
Q = np.array([0.3, 1.2, -0.5, 0.4, 0.9, -0.2])
STATE = np.concatenate([Q, np.zeros(6), Q, np.zeros(6)])


@pytest.fixture(name="robot")
def fixture_robot(load_robot):
    robot = load_robot("comau_racer_1_4")
    # rows of J: angular, linear
    J = robot.jacobian(Q)
    return robot.chain, J[3:].T @ WRENCH[:3] + J[:3].T @ WRENCH[3:]


class Bench:
    """The block at a posture, tick by tick; each result by rows."""

    def __init__(self, chain, num_derivatives=2, **options):
        self.stepper = Stepper(
            ExternalTorque(chain, num_derivatives, PERIOD, **options), ("wrench",)
        )

    def push(self, scale):
        out = self.stepper.step(joint_state=STATE, wrench=scale * WRENCH)
        return out["tau_ext"].reshape(-1, 6)


def test_is_drakes_jacobian_transposed(robot):
    chain, tau = robot
    rows = Bench(chain).push(1.0)
    assert np.allclose(rows[0], tau, rtol=0, atol=1e-10)
    assert np.array_equal(rows[1:], np.zeros((2, 6)))


def test_what_is_connected_adds_up(robot):
    """Torques in the joints add to those of the wrench; unconnected inputs are zero."""
    chain, tau = robot
    link = np.arange(6.0)
    for connected, expected in (
        ((), 0.0 * tau),
        (("link_torque",), link),
        (("wrench", "link_torque"), tau + link),
    ):
        inputs = {"wrench": WRENCH, "link_torque": link}
        stepper = Stepper(ExternalTorque(chain, 0, PERIOD, 50.0), connected)
        out = stepper.step(joint_state=STATE, **{name: inputs[name] for name in connected})
        assert np.allclose(out["tau_ext"], expected, rtol=0, atol=1e-10)


def test_derivatives_of_a_parabola_are_found(robot):
    chain, tau = robot
    bench = Bench(chain, bandwidth=200.0)
    t = PERIOD * np.arange(300)
    rows = [bench.push(scale) for scale in 1.0 + 2.0 * t + 40.0 * t**2][-1]
    expected = np.outer([1.0 + 2.0 * t[-1] + 40.0 * t[-1] ** 2, 2.0 + 80.0 * t[-1], 80.0], tau)
    assert np.allclose(rows, expected, rtol=1e-5, atol=1e-8)


def test_a_constant_wrench_is_there_from_the_first_tick(robot):
    chain, tau = robot
    bench = Bench(chain, bandwidth=50.0)
    for _ in range(6):
        rows = bench.push(1.0)
        assert np.allclose(rows[0], tau, rtol=0, atol=1e-10)
        assert np.allclose(rows[1:], 0.0, rtol=0, atol=1e-6)


@pytest.mark.parametrize("good", [0, 5])
def test_nan_comes_out_and_is_not_remembered(robot, good):
    """Neither in the middle nor at the start."""
    chain, tau = robot
    bench = Bench(chain, bandwidth=50.0)
    for _ in range(good):
        bench.push(1.0)
    for _ in range(3):
        assert np.isnan(bench.push(np.nan)).all()
    rows = bench.push(1.0)
    assert np.allclose(rows[0], tau, rtol=0, atol=1e-10)
    assert np.allclose(rows[1:], 0.0, rtol=0, atol=1e-6)


def test_wrong_numbers_are_refused(robot):
    with pytest.raises(InputError, match="number of derivatives: 3"):
        ExternalTorque(robot[0], 3, PERIOD, 10.0)
    with pytest.raises(InputError, match="bandwidth = -1"):
        ExternalTorque(robot[0], 2, PERIOD, -1.0)
