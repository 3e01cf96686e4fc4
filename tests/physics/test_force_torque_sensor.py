"""The force/torque sensor on Drake's plants, and its signal chain on prescribed loads."""

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, SpatialInertia, UnitInertia, WeldJoint
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LogVectorOutput

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.estimation.filters import LowPass
from pfsc_drake.errors import InputError
from pfsc_drake.physics.force_torque_sensor import ForceTorqueParameters, ForceTorqueSensor
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.robot_model import gravity_function
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.sensor_noise import SensorNoise
from pfsc_drake.systems.plants.reactions import JointReaction, reaction_index

PERIOD = 1e-3
TOOL_MASS, TOOL_COM = 1.5, np.array([0.0, 0.0, 0.06])


class Source(LeafSystem):
    """Reaction forces of eight joints over time; the last one is a given function."""

    def __init__(self, load):
        super().__init__()
        self._load = load
        self.DeclareAbstractOutputPort(
            "reactions",
            lambda: Value[list[SpatialForce]](),
            self._calc,
            prerequisites_of_calc={self.time_ticket()},
        )

    def _calc(self, context, output):
        load = self._load(context.get_time())
        others = [SpatialForce(tau=np.full(3, 7.0), f=np.full(3, 7.0))] * 7
        output.set_value([*others, SpatialForce(tau=-load[3:], f=-load[:3])])


@pytest.fixture(scope="module")
def rigid():
    return make_plant("comau_racer_1_4")


def make_plant(model):
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model(model)))
    plant.Finalize()
    return plant


def quiet(**changes):
    return ForceTorqueParameters(**{"noise": np.zeros(6), **changes})


def record(plant, parameters, load, duration):
    """Return the readings under a load given over time, shape (samples, 6)."""
    builder = DiagramBuilder()
    source = builder.AddSystem(Source(load))
    index = reaction_index(plant, plant.GetJointByName("weld_tool"))
    joint = builder.AddSystem(JointReaction(index))
    sensor = builder.AddSystem(BlockSystem(ForceTorqueSensor(parameters, PERIOD), PERIOD))
    noise = builder.AddSystem(SensorNoise(parameters.noise, parameters.seed, PERIOD))
    builder.Connect(source.get_output_port(), joint.get_input_port())
    builder.Connect(joint.get_output_port(), sensor.GetInputPort("reaction"))
    builder.Connect(noise.get_output_port(), sensor.GetInputPort("noise"))
    log = LogVectorOutput(sensor.GetOutputPort("measured_wrench"), builder, PERIOD)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(duration)
    return log.FindLog(simulator.get_context()).data().T


def reading_at_rest(model, q, wrench=None):
    """Return the reading of a robot that is held still, and the sensor's orientation.

    Args:
        model: Name of the robot.
        q: Joint coordinates of the links.
        wrench: On the tool's origin in world axes.
    """
    plant = make_plant(model)
    chain, coordinates = chain_from_plant(plant, plant.GetFrameByName("tool_point"))
    wrench = np.zeros(6) if wrench is None else wrench
    context = plant.CreateDefaultContext()
    tool = plant.GetBodyByName("tool")
    applied = ExternallyAppliedSpatialForce()
    applied.body_index = tool.index()
    applied.F_Bq_W = SpatialForce(tau=wrench[3:], f=wrench[:3])
    plant.GetInputPort("applied_spatial_force").FixValue(context, [applied])
    weight = np.array(gravity_function(chain)(q)).ravel()
    if np.any(wrench):
        plain = make_plant("comau_racer_1_4")
        at = plain.CreateDefaultContext()
        plain.SetPositions(at, q)
        frame = plain.GetBodyByName("tool").body_frame()
        J = plain.CalcJacobianSpatialVelocity(
            at,
            JacobianWrtVariable.kV,
            frame,
            np.zeros(3),
            plain.world_frame(),
            plain.world_frame(),
        )
        weight = weight - J[3:].T @ wrench[:3] - J[:3].T @ wrench[3:]
    state = np.concatenate([q, np.zeros(6), q + weight / chain.K_s, np.zeros(6)])
    plant.SetPositionsAndVelocities(context, coordinates.plant_state(state))
    plant.get_actuation_input_port().FixValue(context, weight)
    R_WS = tool.EvalPoseInWorld(context).rotation().matrix()
    return reading_of(plant, context, plant.GetJointByName("weld_tool")), R_WS


def reading_of(plant, context, joint):
    """Return the reading of a sensor in a joint, of a plant's context."""
    reaction = JointReaction(reaction_index(plant, joint))
    own = reaction.CreateDefaultContext()
    reaction.get_input_port().FixValue(own, plant.get_reaction_forces_output_port().Eval(context))
    sensor = Stepper(ForceTorqueSensor(quiet(), PERIOD))
    return sensor.step(reaction=reaction.get_output_port().Eval(own))["measured_wrench"]


@pytest.mark.parametrize("model", ["comau_racer_1_4", "comau_racer_1_4_elastic"])
def test_at_rest_it_reads_the_weight_of_the_tool(model):
    random = np.random.default_rng(1)
    for q in random.uniform(-1.5, 1.5, (4, 6)):
        reading, R_WS = reading_at_rest(model, q)
        weight = R_WS.T @ [0.0, 0.0, -9.81 * TOOL_MASS]
        expected = np.concatenate([weight, np.cross(TOOL_COM, weight)])
        assert np.allclose(reading, expected, rtol=0, atol=1e-7)


@pytest.mark.parametrize("model", ["comau_racer_1_4", "comau_racer_1_4_elastic"])
def test_it_reads_what_pushes_on_the_tool_with_its_sign(model):
    q = np.array([0.3, 1.2, -0.4, 0.5, 1.0, -0.7])
    wrench = np.array([12.0, -7.0, 20.0, 1.0, -0.5, 0.8])
    free, R_WS = reading_at_rest(model, q)
    pushed, R_pushed = reading_at_rest(model, q, wrench)
    assert np.allclose(R_WS, R_pushed, rtol=0, atol=1e-12)
    difference = (pushed - free).reshape(2, 3) @ R_WS.T
    assert np.allclose(difference.ravel(), wrench, rtol=0, atol=1e-7)


def test_bias_and_noise_are_those_of_the_parameters(rigid):
    bias = np.array([3.0, -2.0, 1.0, 0.1, 0.2, 0.3])
    noise = np.array([0.1, 0.2, 0.3, 0.01, 0.02, 0.03])
    parameters = ForceTorqueParameters(bias=bias, noise=noise, seed=3)
    readings = record(rigid, parameters, lambda t: np.ones(6), 5.0)
    samples = len(readings)
    mean_error = (readings.mean(axis=0) - bias - 1.0) * np.sqrt(samples) / noise
    assert np.max(np.abs(mean_error)) < 3.5
    assert readings.std(axis=0) == pytest.approx(noise, rel=0.05)
    normed = (readings - readings.mean(axis=0)) / noise
    # white in time and independent between axes
    assert np.max(np.abs((normed[1:] * normed[:-1]).mean(axis=0))) < 4.0 / np.sqrt(samples)
    assert np.max(np.abs(normed.T @ normed / samples - np.eye(6))) < 0.08


def test_noise_is_the_seeds(rigid):
    def run(seed):
        return record(rigid, ForceTorqueParameters(seed=seed), lambda t: np.zeros(6), 0.05)

    assert np.array_equal(run(1), run(1))
    assert not np.any(np.isclose(run(1), run(2), rtol=0, atol=1e-9))


@pytest.mark.slow(but="50.0")
@pytest.mark.parametrize("frequency", [5.0, 50.0, 100.0, 200.0])
def test_amplitude_falls_as_the_bandwidth_says(rigid, frequency):
    def load(t):
        return np.repeat([10.0, 1.0], 3) * np.sin(2.0 * np.pi * frequency * t)

    readings = record(rigid, quiet(bandwidth=100.0), load, 2.0)[1000:2000]
    amplitude = np.sqrt(2.0) * readings.std(axis=0)
    expected = 1.0 / np.sqrt(1.0 + (np.tan(np.pi * frequency / 1e3) / np.tan(np.pi * 0.1)) ** 2)
    assert amplitude == pytest.approx(np.repeat([10.0, 1.0], 3) * expected, rel=1e-3)
    if frequency == 100.0:
        assert expected == pytest.approx(np.sqrt(0.5))


def test_it_saturates_at_the_range(rigid):
    def load(t):
        return np.array([600.0, -600.0, 499.0, 25.0, -25.0, 19.0])

    readings = record(rigid, quiet(), load, 0.01)
    assert np.allclose(readings, [500.0, -500.0, 499.0, 20.0, -20.0, 19.0], rtol=0, atol=1e-9)


def test_a_nan_comes_out_and_does_not_stay(rigid):
    def load(t):
        return np.full(6, np.nan if 0.0045 < t < 0.0055 else 2.0)

    readings = record(rigid, quiet(), load, 0.02)
    assert np.isnan(readings[5]).all()
    assert np.allclose(readings[:5], 2.0, rtol=0, atol=1e-12)
    assert np.allclose(readings[-10:], 2.0, rtol=0, atol=1e-12)


def test_joints_removed_from_the_plant_do_not_shift_it():
    plant = MultibodyPlant(0.0)
    inertia = SpatialInertia(2.0, np.zeros(3), UnitInertia.SolidSphere(0.1))
    bodies = [plant.AddRigidBody(f"body_{i}", inertia) for i in range(3)]
    frames = [plant.world_frame(), *(body.body_frame() for body in bodies)]
    identity = RigidTransform()
    extra = plant.AddJoint(WeldJoint("extra", frames[0], frames[2], identity))
    joints = [
        plant.AddJoint(WeldJoint(f"weld_{i}", frames[i], frames[i + 1], identity)) for i in range(3)
    ]
    plant.RemoveJoint(extra)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    for i, joint in enumerate(joints):
        weight = -9.81 * 2.0 * (3 - i)
        assert reading_of(plant, context, joint)[2] == pytest.approx(weight, abs=1e-10)


def test_a_moving_joint_is_refused(rigid):
    with pytest.raises(InputError, match=r"joint 'joint_6' .* 'revolute'; must be a fixed joint"):
        reaction_index(rigid, rigid.GetJointByName("joint_6"))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("measurement_range", np.zeros(6)),
        ("bias", np.full(6, np.nan)),
        ("noise", np.full(6, -1.0)),
        ("noise", np.zeros(3)),
        ("seed", -1),
    ],
)
def test_parameters_out_of_range(key, value):
    with pytest.raises(InputError, match=f"^{key} = .*; allowed: "):
        ForceTorqueParameters(**{key: value})


RANGE = np.array([10.0, 20.0, 30.0, 1.0, 2.0, 3.0])
BIAS = np.array([0.5, -0.5, 0.0, 0.1, 0.0, -0.1])


class Sensor:
    """A sensor under known loads, against its filter in numpy."""

    def __init__(self):
        self.parameters = quiet(bandwidth=150.0, bias=BIAS, measurement_range=RANGE)
        self.low_pass = LowPass(150.0, PERIOD)
        self.stepper = Stepper(ForceTorqueSensor(self.parameters, PERIOD), ("noise",))

    def step(self, load, noise=0.0):
        # the tool pulls back, and Drake writes the torque first
        reaction = np.roll(np.multiply(load, -1.0), 3)
        result = self.stepper.step(reaction=reaction, noise=np.full(6 * 128, noise))
        np.testing.assert_array_equal(result["load"], load)
        return result["measured_wrench"], self.stepper.states["filter"]


def test_filter_bias_and_noise():
    sensor, rng = Sensor(), np.random.default_rng(0)
    low_pass, expected = sensor.low_pass, None
    for _ in range(5):
        load, noise = rng.uniform(-0.3, 0.3, 6), rng.uniform(-0.3, 0.3)
        expected = low_pass.rest(load) if expected is None else expected
        reading, state = sensor.step(load, noise)
        filtered, expected = low_pass.output(expected, load), low_pass.update(expected, load)
        np.testing.assert_allclose(reading, filtered + BIAS + noise, rtol=0, atol=1e-15)
        np.testing.assert_allclose(state, expected, rtol=0, atol=1e-15)


def test_range_and_nan_component_by_component():
    for sign in (1.0, -1.0):
        reading, _ = Sensor().step(sign * 2.0 * RANGE)
        np.testing.assert_array_equal(reading, sign * RANGE)
    sensor = Sensor()
    sensor.step(np.zeros(6))
    lost = np.where(np.arange(6) == 2, np.nan, 0.1)
    reading, state = sensor.step(lost)
    assert np.array_equal(np.isnan(reading), np.isnan(lost))
    # and it goes on from the next load that is a number, at rest on it
    reading, after = sensor.step(np.full(6, 0.2))
    assert reading[2] == pytest.approx(0.2 + BIAS[2], abs=1e-15)
    assert after[2] == pytest.approx(sensor.low_pass.rest(0.2), abs=1e-15)
    expected = sensor.low_pass.update(state, 0.2)
    np.testing.assert_allclose(np.delete(after, 2), np.delete(expected, 2), rtol=0, atol=1e-15)


def test_noise_is_that_of_the_tick():
    sensor = Stepper(ForceTorqueSensor(quiet(), PERIOD), ("noise",))
    noise = np.random.default_rng(5).normal(size=(128, 6))
    for tick in range(300):
        reading = sensor.step(reaction=np.zeros(6), noise=noise)["measured_wrench"]
        np.testing.assert_array_equal(reading, noise[tick % 128])
