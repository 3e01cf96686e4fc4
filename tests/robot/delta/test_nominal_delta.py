"""What is believed of a DELTA robot."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.robot.delta.delta_parameters import load_delta_parameters
from pfsc_drake.robot.delta.delta_robot import DeltaRobot, nominal_delta
from pfsc_drake.robot.model_error import ModelError
from pfsc_drake.robot.robot_model import pose_function


@pytest.fixture(scope="module")
def robot():
    return DeltaRobot(load_delta_parameters())


def _force(robot, q, v, a):
    """Inverse dynamics by Lagrange's equations on the kinetic and potential energy."""
    x, rate = ca.SX.sym("q", 3), ca.SX.sym("v", 3)
    y = robot.tool_pose([Jet([x[i], rate[i]]) for i in range(3)])[0]
    masses, gravity = robot.parameters.masses, ca.DM(robot.gravity)
    rails = ca.DM(robot.parameters.geometry.rails)
    velocity, position = y.derivative(1), y.derivative(0)
    kinetic = 0.5 * masses.effective_slide * ca.sumsqr(rate)
    kinetic += 0.5 * masses.effective_plate * ca.sumsqr(velocity)
    potential = -masses.effective_plate * ca.dot(gravity, position)
    for i in range(3):  # slides move along -c_i
        potential += masses.effective_slide * ca.dot(gravity, rails[i, :].T) * x[i]
    momentum = ca.gradient(kinetic, rate)
    force = ca.jtimes(momentum, x, rate) - ca.gradient(kinetic - potential, x)
    D = ca.jacobian(momentum, rate)
    function = ca.Function("f", [x, rate], [force, D])
    bias, D = (np.array(part) for part in function(q, v))
    return bias.ravel() + D @ a


def _torques(robot, q, v, a):
    joints = [Jet.from_derivatives([ca.SX(x) for x in (q[i], v[i], a[i])]) for i in range(3)]
    tau = ca.vertcat(*[t.derivative(0) for t in robot.inverse_dynamics(joints)])
    return np.array(ca.DM(tau)).ravel()


def test_masses_and_lengths(robot):
    error = replace(
        ModelError.none(3),
        mass=np.array([1.1, 0.9, 1.05]),
        link_length=np.array([1.01, 0.99, 1.02]),
        tool_mass=0.1,
    )
    nominal = nominal_delta(robot, error)
    true, masses = robot.parameters, nominal.parameters.masses
    assert masses.effective_slide == pytest.approx(
        1.1 * true.masses.slide + 2.0 / 3.0 * 0.9 * true.masses.rod_pair
    )
    plate = 1.05 * (true.masses.plate + true.masses.load) + 0.1 + 0.9 * true.masses.rod_pair
    assert masses.effective_plate == pytest.approx(plate)
    q = robot.joint_coordinates(np.array([0.02, -0.03, 0.55]), "here")
    v, a = np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, -1.0])
    np.testing.assert_allclose(_torques(nominal, q, v, a), _force(nominal, q, v, a), atol=1e-9)
    # rods of the believed length, from the believed rails
    pose, geometry = np.array(pose_function(nominal)(q)).ravel(), nominal.parameters.geometry
    rods = pose[:3] - geometry.offsets + q[:, None] * geometry.rails
    np.testing.assert_allclose(np.linalg.norm(rods, axis=1), 0.99 * true.geometry.l_BC, rtol=1e-9)
    assert geometry.l_A == pytest.approx(1.01 * true.geometry.l_A)
    assert geometry.l_EC == pytest.approx(1.02 * true.geometry.l_EC)


def test_no_error_leaves_everything(robot):
    q = np.array([0.3, 0.3, 0.3])
    v, a = np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, -1.0])
    nominal = nominal_delta(robot, ModelError.none(3))
    np.testing.assert_array_equal(_torques(nominal, q, v, a), _torques(robot, q, v, a))


def test_what_no_delta_robot_can_be(robot):
    with pytest.raises(InputError, match=r"tool_mass = -50 kg; allowed: .* kg or more"):
        nominal_delta(robot, replace(ModelError.none(3), tool_mass=-50.0))
    with pytest.raises(InputError, match=r"joint_offset = .* allowed: 0 for a DELTA robot"):
        nominal_delta(robot, replace(ModelError.none(3), joint_offset=np.array([0.1, 0.0, 0.0])))
