"""Load of the tool, its compensation and the filter, against Drake and closed forms."""

import casadi as ca
import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces, SpatialInertia

from pfsc_drake.control.compliance.tool_compensation import compensation_function
from pfsc_drake.control.estimation.filters import LowPass
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.robot.tool_load import dead_band, joint_torque_function
from pfsc_drake.systems.plants.reactions import tool_load_from_plant

PERIOD = 1e-3


class Robot:
    """The rigid robot with its tool; the sensor sits in front of the tool."""

    def __init__(self):
        self.plant = MultibodyPlant(0.0)
        Parser(self.plant).AddModels(str(resolve_model("comau_racer_1_4")))
        self.plant.Finalize()
        self.tool = self.plant.GetFrameByName("tool_point")
        self.joint = self.plant.GetJointByName("weld_tool")
        self.chain, _ = chain_from_plant(self.plant, self.tool)
        self.load = tool_load_from_plant(self.plant, self.joint, self.tool)

    def reading(self, q, v, a, wrench):
        """Return minus Drake's reaction at the sensor for a motion under an external wrench."""
        plant, context = self.plant, self.plant.CreateDefaultContext()
        plant.SetPositionsAndVelocities(context, np.concatenate([q, v]))
        applied = ExternallyAppliedSpatialForce()
        applied.body_index = self.tool.body().index()
        applied.p_BoBq_B = self.tool.GetFixedPoseInBodyFrame().translation()
        applied.F_Bq_W = SpatialForce(tau=wrench[3:], f=wrench[:3])
        plant.GetInputPort("applied_spatial_force").FixValue(context, [applied])
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        J = plant.CalcJacobianSpatialVelocity(
            context,
            JacobianWrtVariable.kV,
            self.tool,
            np.zeros(3),
            plant.world_frame(),
            plant.world_frame(),
        )
        tau_ext = J[3:].T @ wrench[:3] + J[:3].T @ wrench[3:]
        tau = plant.CalcInverseDynamics(context, a, forces) - tau_ext
        plant.get_actuation_input_port().FixValue(context, tau)
        reaction = plant.get_reaction_forces_output_port().Eval(context)[7]
        return -np.concatenate([reaction.translational(), reaction.rotational()]), tau_ext


@pytest.fixture(scope="module")
def robot():
    return Robot()


def test_everything_that_is_fixed_behind_the_sensor_is_tool():
    """A gripper with a finger on it: the inertia is that which Drake finds of both together."""
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4")))
    finger_inertia = SpatialInertia.SolidBoxWithMass(0.8, 0.1, 0.04, 0.2)
    finger = plant.AddRigidBody(
        "finger", plant.GetFrameByName("tool_point").model_instance(), finger_inertia
    )
    tool, joint = plant.GetFrameByName("tool_point"), plant.GetJointByName("weld_tool")
    X_TF = RigidTransform(RollPitchYaw(0.3, -0.2, 0.5), [0.05, -0.03, 0.1])
    plant.WeldFrames(tool, finger.body_frame(), X_TF)
    plant.Finalize()
    load = tool_load_from_plant(plant, joint, tool)
    bodies = [joint.child_body().index(), finger.index()]
    context = plant.CreateDefaultContext()
    M = plant.CalcSpatialInertia(context, joint.frame_on_child(), bodies)
    alone = joint.child_body().default_mass()
    assert load.mass == pytest.approx(alone + 0.8, rel=1e-12)
    np.testing.assert_allclose(load.p_SC, M.get_com(), atol=1e-12)
    I_C = M.Shift(M.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    np.testing.assert_allclose(load.I_C, I_C, atol=1e-12)


def states(seed, n=8):
    random = np.random.default_rng(seed)
    for _ in range(n):
        yield (
            random.uniform(-1.5, 1.5, 6),
            random.uniform(-2, 2, 6),
            random.uniform(-9, 9, 6),
            random.uniform(-50, 50, 6),
        )


def test_tool_load_is_that_of_the_model_file(robot):
    load = robot.load
    assert load.mass == pytest.approx(1.5, rel=1e-12)
    assert load.p_SC == pytest.approx([0.0, 0.0, 0.06], abs=1e-15)
    assert np.allclose(load.I_C, np.diag([0.006, 0.0085, 0.0084]), rtol=0, atol=1e-15)
    assert load.p_ST == pytest.approx([0.0, 0.0, 0.12], abs=1e-15)
    assert load.gravity == pytest.approx([0.0, 0.0, -9.81])


def test_a_tool_load_needs_a_fixed_joint_in_front_of_the_tool(robot):
    plant, tool = robot.plant, robot.tool
    with pytest.raises(InputError, match="'joint_6' of the force/torque sensor: type 'revolute'"):
        tool_load_from_plant(plant, plant.GetJointByName("joint_6"), tool)
    with pytest.raises(InputError, match="'joint_1': moves behind the force/torque sensor in"):
        tool_load_from_plant(plant, plant.GetJointByName("weld_base"), tool)
    base = plant.GetFrameByName("link_6")
    with pytest.raises(InputError, match="tool frame 'link_6': is not behind the joint"):
        tool_load_from_plant(plant, plant.GetJointByName("weld_tool"), base)


def compensate(robot):
    """Return ``(q, v, a, measured, bias) -> (wrench, residual)`` of a motion known exactly."""
    function = compensation_function(robot.chain, robot.load, LowPass(200.0, PERIOD), "given")

    def evaluate(q, v, a, measured, bias):
        return function(np.concatenate([q, v, a]), np.zeros(18), 0.0, measured, bias)[:2]

    return evaluate


def test_the_external_wrench_is_recovered_from_drakes_reaction(robot):
    """Weight, inertia, gyroscopic torque, sign, point and frame in one."""
    function = compensate(robot)
    bias = np.array([1.0, -2.0, 3.0, 0.1, 0.2, -0.3])
    for q, v, a, wrench in states(1):
        reading, _ = robot.reading(q, v, a, wrench)
        estimate, _ = function(q, v, a, reading + bias, bias)
        assert np.allclose(np.array(estimate).ravel(), wrench, rtol=0, atol=1e-9)


def test_the_residual_of_a_free_tool_is_the_bias(robot):
    function = compensate(robot)
    bias = np.arange(6.0)
    for q, v, a, _ in states(2):
        reading, _ = robot.reading(q, v, a, np.zeros(6))
        _, residual = function(q, v, a, reading + bias, np.zeros(6))
        assert np.allclose(np.array(residual).ravel(), bias, rtol=0, atol=1e-9)


def test_joint_torques_are_those_of_drakes_jacobian(robot):
    function = joint_torque_function(robot.chain)
    for q, v, a, wrench in states(3):
        _, tau_ext = robot.reading(q, v, a, wrench)
        assert np.allclose(np.array(function(q, wrench)).ravel(), tau_ext, rtol=0, atol=1e-10)


@pytest.mark.parametrize("length", [0.0, 0.5, 0.999, 1.0, 1.5, 10.0])
def test_dead_band_shortens_and_keeps_the_direction(length):
    vector = ca.SX.sym("vector", 3)
    function = ca.Function("f", [vector], [dead_band(vector, 1.0)])
    direction = np.array([2.0, -1.0, 2.0]) / 3.0
    expected = max(length - 1.0, 0.0) * direction
    assert np.allclose(np.array(function(length * direction)).ravel(), expected, rtol=0, atol=1e-14)


def response(low_pass, frequency, kind):
    """Return the complex gain at a frequency, after the transient."""
    k = np.arange(4000)
    signal = np.exp(2j * np.pi * frequency * k * PERIOD)
    result = []
    for part in (signal.real, signal.imag):
        state, out = np.zeros(1), []
        for sample in part:
            now = np.array([sample])
            out.append(float(getattr(low_pass, kind)(state, now)[0]))
            state = low_pass.update(state, now)
        result.append(np.array(out))
    return ((result[0] + 1j * result[1]) / signal)[2000:].mean()


@pytest.mark.parametrize("bandwidth", [20.0, 200.0, 450.0])
def test_low_pass_is_down_by_three_decibel_at_its_bandwidth(bandwidth):
    low_pass = LowPass(bandwidth, PERIOD)
    assert abs(response(low_pass, bandwidth, "output")) == pytest.approx(np.sqrt(0.5), abs=1e-9)
    assert np.angle(response(low_pass, bandwidth, "output")) == pytest.approx(-np.pi / 4, abs=1e-9)
    assert abs(response(low_pass, 0.5, "output")) == pytest.approx(1.0, abs=1e-3)


def test_derivative_lags_like_the_low_pass():
    low_pass, frequency = LowPass(200.0, PERIOD), 5.0
    s = 2j * np.pi * frequency
    ratio = response(low_pass, frequency, "derivative") / response(low_pass, frequency, "output")
    assert ratio == pytest.approx(s, rel=1e-3)


def test_low_pass_rests_on_a_sample():
    low_pass, sample = LowPass(100.0, PERIOD), np.array([3.0, -4.0])
    state = low_pass.rest(sample)
    for _ in range(5):
        assert np.allclose(low_pass.output(state, sample), sample, rtol=0, atol=1e-14)
        assert np.allclose(low_pass.derivative(state, sample), 0.0, rtol=0, atol=1e-10)
        state = low_pass.update(state, sample)


@pytest.mark.parametrize("bandwidth", [0.0, -1.0, 500.0, np.nan])
def test_bandwidth_out_of_range(bandwidth):
    with pytest.raises(InputError, match=r"bandwidth = .* below half the sampling rate, 500 Hz"):
        LowPass(bandwidth, PERIOD)
