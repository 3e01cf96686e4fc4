"""Models without masses or effort limits, for joints that follow velocity servos."""

import numpy as np
import pytest

from pfsc_drake.physics.velocity_servo import VelocityServoLaw, joint_inertia, servo_gains
from pfsc_drake.robot.models.elastic_joints import ElasticJoints
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant

_WEAK = '<limit lower="-2" upper="2" effort="0" velocity="1.5"/>'
_DAMPED = '<limit lower="-2" upper="2" effort="30" velocity="1.5"/><dynamics damping="3"/>'
_TRANSMISSION = (
    '<transmission name="t"><type>transmission_interface/SimpleTransmission</type>'
    '<joint name="shoulder"/><actuator name="motor"><mechanicalReduction>1</mechanicalReduction>'
    "</actuator></transmission>"
)


@pytest.fixture(name="arm")
def fixture_arm(urdf_parts):
    """Return the text of an arm whose links have what is given, and joints likewise."""
    _, link, joint = urdf_parts

    def text(upper, lower, joints, further=""):
        parts = link("base", "") + link("upper", *upper) + link("lower", *lower) + link("tcp", "")
        parts += joint("shoulder", "base", "upper", joints)
        parts += joint("elbow", "upper", "lower", joints, axis="0 1 0")
        parts += joint("flange", "lower", "tcp", "", "fixed", xyz="0.4 0 0.1")
        return f'<robot name="arm">\n{parts}{further}</robot>\n'

    return text


@pytest.fixture(name="massless")
def fixture_massless(arm, write):
    """A model of which one link has mass, the other none, with damping, a limit and a drive."""
    return write(arm((), ("",), _DAMPED, _TRANSMISSION))


def test_an_arm_without_masses_has_integrators_for_joints(massless, read):
    plant, warnings = read(massless, by_velocity=True)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, [0.4, -0.7])
    np.testing.assert_array_equal(plant.CalcMassMatrix(context), np.eye(2))
    np.testing.assert_array_equal(plant.CalcGravityGeneralizedForces(context), 0.0)
    chain, _ = chain_from_plant(plant, plant.GetFrameByName("tcp"))
    assert chain.is_massless
    np.testing.assert_array_equal(chain.gather("effort_limit"), np.inf)
    np.testing.assert_array_equal(chain.gather("velocity_limit"), 1.5)
    np.testing.assert_array_equal(chain.viscous_damping, 0.0)
    assert len(warnings) == 1 and "without mass" in warnings[0] and str(massless) in warnings[0]


def test_joints_without_masses_follow_with_the_lag_of_their_servos(massless, read):
    """After k ticks they have 1 - exp(-k omega T) of the speed, whatever the links are like."""
    plant, _ = read(massless, by_velocity=True)
    chain, _ = chain_from_plant(plant, plant.GetFrameByName("tcp"))
    omega, period, expected = 80.0, 2e-3, np.array([0.3, -0.9])
    gains = servo_gains(joint_inertia(chain, np.array([0.4, -0.7])), omega, period)
    law = VelocityServoLaw(gains, chain.gather("effort_limit"))
    context, v, x = plant.CreateDefaultContext(), np.zeros(2), np.zeros(2)
    for _ in range(7):
        torque, x = (np.array(each).ravel() for each in law.torque(v, expected, np.zeros(2), x))
        plant.get_actuation_input_port().FixValue(context, torque)
        v = v + period * plant.EvalTimeDerivatives(context).CopyToVector()[2:]
        plant.SetVelocities(context, v)
    np.testing.assert_allclose(v, expected * (1.0 - np.exp(-7 * omega * period)), rtol=1e-12)


def test_torques_need_masses(massless, read, refused):
    refused(lambda: read(massless), massless, "'lower'", "no <inertial>")


@pytest.mark.parametrize(
    ("option", "value"),
    [("elastic", ElasticJoints(stiffness=np.array([1e4]))), ("joint_damping", [2.0])],
)
def test_springs_need_masses(massless, read, refused, option, value):
    refused(lambda: read(massless, by_velocity=True, **{option: value}), f"{option}:", "mass")


def test_an_effort_of_zero_limits_no_servo(arm, write, read, refused):
    file = write(arm((), (), _WEAK))
    plant, warnings = read(file, by_velocity=True)
    chain, _ = chain_from_plant(plant, plant.GetFrameByName("tcp"))
    np.testing.assert_array_equal(chain.gather("effort_limit"), np.inf)
    np.testing.assert_array_equal(chain.gather("mass"), 2.0)
    np.testing.assert_array_equal(chain.gravity, [0.0, 0.0, -9.81])
    assert warnings == [f"{file}: effort limits of 0 (shoulder, elbow) are taken for none"]
    refused(lambda: read(file), file, "'shoulder'", "effort = 0")


def test_what_has_masses_and_limits_keeps_them(arm, write, read):
    """Also behind servos: torques that are known to be limited are."""
    plant, warnings = read(write(arm((), (), _DAMPED)), by_velocity=True)
    chain, _ = chain_from_plant(plant, plant.GetFrameByName("tcp"))
    np.testing.assert_array_equal(chain.gather("effort_limit"), 30.0)
    np.testing.assert_array_equal(chain.viscous_damping, 3.0)
    assert not chain.is_massless and not warnings
