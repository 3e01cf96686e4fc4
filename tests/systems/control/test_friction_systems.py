"""Friction compensation and the friction Kalman filter as systems."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from pfsc_drake.control.estimation.friction_kalman import FrictionKalmanFilter, FrictionNoise
from pfsc_drake.control.estimation.generalized_momentum import drive_momentum
from pfsc_drake.systems.control.following_controller import FollowingController
from pfsc_drake.systems.control.friction_compensation import FrictionCompensation
from pfsc_drake.systems.control.friction_estimator import FrictionEstimator

PERIOD = 1e-3
F_C, F_V = np.array([20.0, 35.0, 9.0]), np.array([5.0, 8.0, 2.0])
Q, V = np.array([0.3, 1.2, -0.5]), np.array([0.2, -0.3, 0.4])
STATE = np.concatenate([Q, V, Q, V])


@pytest.mark.parametrize("size", [3, 12])
def test_the_model_takes_the_last_velocities(size):
    system = FrictionCompensation(F_C, F_V, 0.1, size)
    context = system.CreateDefaultContext()
    system.GetInputPort("velocity").FixValue(context, STATE[-size:])
    np.testing.assert_allclose(
        system.GetOutputPort("friction_torque").Eval(context),
        F_C * np.tanh(V / 0.1) + F_V * V,
        rtol=1e-12,
    )


@pytest.fixture(name="kalman")
def fixture_kalman(arm):
    noise = FrictionNoise(*([x] * 3 for x in (1e-4, 1e-4, 1e-4, 1e-2)), 1e3)
    start = 0.7 * np.array([F_C, F_V])
    return FrictionKalmanFilter(drive_momentum(arm.chain), start, noise, PERIOD)


def test_the_estimator_is_the_filter(arm, kalman):
    """Tick by tick as the filter by itself; a new start forgets."""
    system = FrictionEstimator(kalman, PERIOD)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    drive, known = arm.weight(Q) + F_C, np.array([1.0, -2.0, 0.5])
    for name, value in (("joint_state", STATE), ("drive_torque", drive), ("known_torque", known)):
        system.GetInputPort(name).FixValue(context, value)
    simulator.Initialize()
    memory = kalman.initial_memory.copy()
    for k in range(5):
        expected = kalman.estimate(memory, STATE).copy()
        estimate = system.GetOutputPort("estimate").Eval(context)
        assert np.array_equal(estimate, expected)
        assert np.array_equal(system.GetOutputPort("friction_torque").Eval(context), expected[:3])
        kalman.remember(memory, STATE, drive, known)
        simulator.AdvanceTo((k + 1) * PERIOD)
    assert np.abs(estimate[3:6] - 0.7 * F_C).max() > 1e-3
    context.SetTime(0.0)
    simulator.Initialize()
    np.testing.assert_allclose(
        system.GetOutputPort("estimate").Eval(context)[3:6], 0.7 * F_C, rtol=1e-14
    )


def test_the_torque_is_that_of_another_velocity_if_it_is_given(kalman):
    system = FrictionEstimator(kalman, PERIOD)
    context = system.CreateDefaultContext()
    system.GetInputPort("joint_state").FixValue(context, STATE)
    system.GetInputPort("velocity").FixValue(context, -V)
    measured = kalman.estimate(kalman.initial_memory, STATE)[:3].copy()
    np.testing.assert_allclose(
        system.GetOutputPort("friction_torque").Eval(context), -measured, rtol=1e-12
    )


def test_the_velocity_that_the_reference_asks_for(arm, path, make_law):
    """The joints at that velocity have the reference's rate; told a tick later, zero before."""
    law = make_law(tells_reference_velocity=True)
    system, theta = FollowingController(law, PERIOD), 0.6
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    q = arm.reach(path.position.derivatives(theta, 0)[0] + np.array([0.004, -0.006, 0.005]))
    point = path.evaluator(2)(arm.pose(q)[:3].tolist(), theta)
    reference = np.zeros(9)
    reference[:6] = [point[1] + 0.01, 0.001, 0.0, 0.4, -0.1, 0.05]

    def fix(v):
        state = np.concatenate([q, v, q, v])
        values = {"joint_state": state, "manifold_point": point, "reference": reference}
        for name, value in values.items():
            system.GetInputPort(name).FixValue(context, value)

    fix(V)
    simulator.Initialize()
    told = system.GetOutputPort("reference_velocity")
    assert not told.Eval(context).any()
    simulator.AdvanceTo(PERIOD)
    wanted = told.Eval(context).copy()
    fix(wanted)
    rate = system.GetOutputPort("manifold_state").Eval(context)[3:]
    np.testing.assert_allclose(rate, reference[3:6], rtol=0, atol=1e-12)
    assert np.abs(wanted - V).min() > 1e-3


def test_a_law_that_does_not_tell_velocities_has_no_such_port(make_law):
    assert not FollowingController(make_law(), PERIOD).HasOutputPort("reference_velocity")
