"""Drive demand of a motion against Drake's inverse dynamics along it."""

import numpy as np
import pytest

from pfsc_drake.control.planning.drive_demand import DriveDemand, DriveLimits, apply_scaling
from pfsc_drake.errors import InputError

ELASTIC = "comau_racer_1_4_elastic"
MIDDLE = np.array([0.2, 1.4, -0.4, 0.3, 1.1, -0.2])


def sway(times):
    """Return joint coordinates and derivatives 0..4 of a motion, shape (samples, 5, 6)."""
    size, rate = np.linspace(0.1, 0.3, 6), np.linspace(4.0, 9.0, 6)
    phases = np.multiply.outer(np.asarray(times), rate)
    waves = [np.sin, np.cos, lambda x: -np.sin(x), lambda x: -np.cos(x), np.sin]
    motion = np.stack([size * rate**k * wave(phases) for k, wave in enumerate(waves)], axis=-2)
    motion[..., 0, :] += MIDDLE
    return motion


def joint_torque(rigid, time):
    """Return the links' torques from Drake's inverse dynamics."""
    q, v, a = sway(time)[:3]
    D_E, n_E = rigid.link_dynamics(q, v)
    return D_E @ a + n_E


@pytest.mark.parametrize("time", [0.0, 0.37, 1.1])
def test_torque_of_rigid_joints(time, load_robot):
    robot = load_robot("comau_racer_1_4")
    motion = sway(time)
    expected = joint_torque(robot, time) + robot.chain.D_M * motion[2]
    demand = DriveDemand(robot.chain, "rigid").of(motion[None, :3])[0]
    assert np.allclose(demand[:6], expected, rtol=0, atol=1e-9)
    assert np.array_equal(demand[6:], motion[1])


@pytest.mark.parametrize("time", [0.0, 0.37, 1.1])
def test_torque_of_elastic_joints(time, load_robot):
    """The motors' acceleration by differences of their positions behind the springs."""
    robot, rigid, h = load_robot(ELASTIC), load_robot("comau_racer_1_4"), 1e-3
    steps = h * np.arange(-3, 4)
    torques = np.array([joint_torque(rigid, time + step) for step in steps])
    q_M = sway(time + steps)[:, 0] + torques / robot.chain.K_s
    second = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / (180.0 * h**2)
    first = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / (60.0 * h)
    viscous = np.linspace(1.0, 3.0, 6)
    expected = robot.chain.D_M * (second @ q_M) + torques[3] + viscous * (first @ q_M)
    demand = DriveDemand(robot.chain, "elastic", viscous).of(sway(time)[None])[0]
    assert np.abs(expected - torques[3]).max() > 5.0
    assert np.allclose(demand[:6], expected, rtol=1e-6, atol=1e-3)


def test_boundary_layer_takes_its_share(load_robot):
    robot, rigid, h = load_robot(ELASTIC), load_robot("comau_racer_1_4"), 1e-4
    damping = np.linspace(1e-3, 4e-3, 6)
    slow = DriveDemand(robot.chain, "rigid").of(sway(0.4)[None, :3])[0]
    demand = DriveDemand(robot.chain, "singular_perturbation", None, damping)
    whole = demand.of(sway(0.4)[None, :4])[0]
    rate = (joint_torque(rigid, 0.4 + h) - joint_torque(rigid, 0.4 - h)) / (2.0 * h)
    assert np.allclose(whole - slow, [*(-damping * rate), *np.zeros(6)], rtol=1e-6, atol=1e-4)


def test_demand_at_constant_scaling_is_a_polynomial(load_robot):
    demand, trajectory = DriveDemand(load_robot(ELASTIC).chain, "elastic"), sway([0.1, 0.5])
    coefficients = demand.at_constant_rate(trajectory)
    for scaling in (0.0, 0.3, 0.8, 1.3):
        demanded = np.einsum("skn,k->sn", coefficients, scaling ** np.arange(5))
        rates = np.tile([scaling, 0.0, 0.0, 0.0], (2, 1))
        assert np.allclose(
            demanded, demand.of(apply_scaling(trajectory, rates)), rtol=1e-9, atol=1e-7
        )


def test_derivatives_of_a_motion_at_a_changing_scaling():
    """``Q(tau(t))`` by differences."""
    t, h = 0.3, 2e-3
    tau = np.polynomial.Polynomial([0.1, 0.6, 0.4, -0.7, 0.5])
    rates = np.array([[tau.deriv(k)(t) for k in (1, 2, 3, 4)]])
    motion = apply_scaling(sway([tau(t)]), rates)[0]
    for k in range(4):
        around = [apply_scaling(sway([tau(s)]), np.array([[tau.deriv(j)(s) for j in (1, 2, 3, 4)]]))
                  for s in t + h * np.array([-2.0, -1.0, 1.0, 2.0])]  # fmt: skip
        slope = np.array([1.0, -8.0, 8.0, -1.0]) @ np.array([x[0, k] for x in around]) / (12.0 * h)
        assert np.allclose(motion[k + 1], slope, rtol=1e-4, atol=1e-4)


def test_limits_must_be_positive():
    with pytest.raises(InputError, match="limits of speed"):
        DriveLimits(np.ones(2), np.array([1.0, 0.0]))
