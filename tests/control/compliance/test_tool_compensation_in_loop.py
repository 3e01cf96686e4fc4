"""Compensation and taring on moving robots in closed loop, with sensor and external wrenches."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LogVectorOutput, MatrixGain, ZeroOrderHold

from pfsc_drake.control.compliance.tool_compensation import (
    SensorFault,
    ToolCompensation,
    ToolCompensationParameters,
)
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.physics.force_torque_sensor import ForceTorqueParameters, ForceTorqueSensor
from pfsc_drake.physics.scripted_force import ForceProfile, ForcePulse, ScriptedForce
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.robot_model import gravity_function
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.sensor_noise import SensorNoise
from pfsc_drake.systems.plants.applied_wrenches import ExternalWrench
from pfsc_drake.systems.plants.reactions import JointReaction, reaction_index, tool_load_from_plant

PERIOD = 1e-3
MODELS = ["comau_racer_1_4", "comau_racer_1_4_elastic"]
REST = np.array([0.2, 1.4, -0.5, 0.3, 1.0, -0.4])
START = 0.1
TARED = slice(100, None)
RANGE = np.repeat([500.0, 20.0], 3)


class Mover(LeafSystem):
    """Computed torque of the rigid robot along ``REST + A sin(w (t - START))^3``."""

    def __init__(self, chain, amplitude, frequency):
        super().__init__()
        self._plant = load_plant("comau_racer_1_4")
        self._context = self._plant.CreateDefaultContext()
        self._amplitude, self._pulsation = amplitude, 2.0 * np.pi * frequency
        self._D_M = chain.D_M
        self._state = self.DeclareVectorInputPort("joint_state", 24)
        self.DeclareVectorOutputPort("drive", 6, self._calc)

    def reference(self, t):
        w, A = self._pulsation, self._amplitude
        s, c = np.sin(w * max(t - START, 0.0)), np.cos(w * max(t - START, 0.0))
        return REST + A * s**3, A * w * 3 * s**2 * c, A * w**2 * (6 * s * c**2 - 3 * s**3)

    def _calc(self, context, output):
        q, v, a = self.reference(context.get_time())
        q_M, v_M = self._state.Eval(context)[12:].reshape(2, 6)
        self._plant.SetPositionsAndVelocities(self._context, np.concatenate([q, v]))
        forces = MultibodyForces(self._plant)
        self._plant.CalcForceElementsContribution(self._context, forces)
        tau = self._plant.CalcInverseDynamics(self._context, a, forces)
        output.SetFromVector(tau + self._D_M * (60.0**2 * (q - q_M) + 60.0 * (v - v_M)))


def load_plant(model):
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model(model)))
    plant.Finalize()
    return plant


def run(
    model, *, amplitude=0.0, frequency=1.0, pulses=(), sensor=None, compensation=None, duration=0.5
):
    """Return the signals of a moving robot with a sensor, each (samples, size)."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(load_plant(model))
    tool, weld = plant.GetFrameByName("tool_point"), plant.GetJointByName("weld_tool")
    chain, coordinates = chain_from_plant(plant, tool)
    encoders = MatrixGain(np.vstack([coordinates.link_rows, coordinates.motor_rows]))
    builder.AddSystem(encoders)
    mover = builder.AddSystem(Mover(chain, np.full(6, amplitude), frequency))
    sensor = sensor or ForceTorqueParameters(noise=np.zeros(6))
    compensation = compensation or ToolCompensationParameters()
    ft = builder.AddSystem(BlockSystem(ForceTorqueSensor(sensor, PERIOD), PERIOD))
    noise = builder.AddSystem(SensorNoise(sensor.noise, sensor.seed, PERIOD))
    joint = builder.AddSystem(JointReaction(reaction_index(plant, weld)))
    block = ToolCompensation(
        chain,
        tool_load_from_plant(plant, weld, tool),
        sensor.measurement_range,
        compensation,
        PERIOD,
    )
    tool_compensation = builder.AddSystem(BlockSystem(block, PERIOD))
    force = ScriptedForce(ForceProfile(pulses), PathManifold(2, oriented=False), PERIOD)
    script = builder.AddSystem(BlockSystem(force, PERIOD))
    external = builder.AddSystem(ExternalWrench(tool, chain))
    connect = builder.Connect
    connect(plant.get_state_output_port(), encoders.get_input_port())
    joint_state = encoders.get_output_port()
    connect(joint_state, mover.get_input_port())
    hold = builder.AddSystem(ZeroOrderHold(PERIOD, 6))
    connect(mover.get_output_port(), hold.get_input_port())
    connect(hold.get_output_port(), plant.get_actuation_input_port())
    connect(plant.get_reaction_forces_output_port(), joint.get_input_port())
    connect(joint.get_output_port(), ft.GetInputPort("reaction"))
    connect(noise.get_output_port(), ft.GetInputPort("noise"))
    connect(ft.GetOutputPort("measured_wrench"), tool_compensation.GetInputPort("measured_wrench"))
    connect(joint_state, tool_compensation.GetInputPort("joint_state"))
    connect(joint_state, external.GetInputPort("joint_state"))
    connect(script.GetOutputPort("wrench"), external.GetInputPort("wrench"))
    connect(
        external.GetOutputPort("applied_spatial_force"),
        plant.GetInputPort("applied_spatial_force"),
    )
    if compensation.inertia == "given":
        connect(
            plant.get_generalized_acceleration_output_port(),
            tool_compensation.GetInputPort("joint_acceleration"),
        )
    ports = {
        "raw": ft.GetOutputPort("measured_wrench"),
        "applied": script.GetOutputPort("wrench"),
        **{key: tool_compensation.GetOutputPort(key) for key in ("wrench", "tared", "fault")},
    }
    logs = {name: LogVectorOutput(port, builder, PERIOD) for name, port in ports.items()}
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    weight = np.array(gravity_function(chain)(REST)).ravel()
    start = np.concatenate([REST, np.zeros(6), REST + weight / chain.K_s, np.zeros(6)])
    plant.SetPositionsAndVelocities(
        plant.GetMyMutableContextFromRoot(root), coordinates.plant_state(start)
    )
    hold.SetVectorState(hold.GetMyMutableContextFromRoot(root), weight)
    simulator.AdvanceTo(duration)
    return {name: log.FindLog(root).data().T for name, log in logs.items()}


def rms(signal):
    return np.sqrt(np.mean(signal**2))


@pytest.mark.slow(but="comau_racer_1_4")
@pytest.mark.parametrize("model", MODELS)
def test_at_rest_a_biased_sensor_gives_zero_and_then_noise(model):
    noise = np.repeat([0.1, 0.004], 3)
    sensor = ForceTorqueParameters(
        bias=np.array([9.0, -14.0, 20.0, 0.5, -0.7, 0.3]), noise=noise, seed=4
    )
    signals = run(model, sensor=sensor, duration=0.4)
    # samples 0 .. 49 make the bias
    assert not np.any(signals["wrench"][:50])
    assert np.array_equal(signals["tared"].ravel(), np.arange(401) >= 50)
    rest = signals["wrench"][50:]
    # torques at the tool point gain the force noise times the lever of 0.12 m
    expected = np.append(noise[:3], np.hypot(noise[3], 0.12 * noise[0]) * np.ones(3))
    assert np.all(rest.std(axis=0) < 1.3 * expected)
    assert np.all(np.abs(rest.mean(axis=0)) < 4.0 * expected / np.sqrt(50))


@pytest.mark.slow(but="comau_racer_1_4_elastic")
@pytest.mark.parametrize("model", MODELS)
def test_a_known_wrench_is_found_to_the_noise_level(model):
    pulse = ForcePulse(0.1, 0.9, [15.0, -25.0, 10.0], [1.0, 0.5, -0.8], ramp=0.1)
    sensor = ForceTorqueParameters(bias=np.array([5.0, 5.0, -5.0, 0.2, 0.2, 0.2]), seed=5)
    signals = run(model, pulses=[pulse], sensor=sensor, duration=0.7, amplitude=0.02)
    plateau = slice(300, 700)
    error = signals["wrench"][plateau] - signals["applied"][plateau]
    assert signals["applied"][400] == pytest.approx([15, -25, 10, 1, 0.5, -0.8])
    assert np.all(error.std(axis=0) < np.repeat([0.13, 0.02], 3))
    assert np.all(np.abs(error.mean(axis=0)) < np.repeat([0.08, 0.012], 3))


@pytest.mark.slow
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("sensor_bandwidth", "share"), [(200.0, 0.002), (100.0, 0.05)])
def test_inertia_of_a_fast_motion_is_taken_off(model, sensor_bandwidth, share):
    """Almost all of it with the sensor's own bandwidth, most of it with another."""
    sensor = ForceTorqueParameters(noise=np.zeros(6), bandwidth=sensor_bandwidth)
    signals = run(model, amplitude=0.1, frequency=2.0, duration=1.0, sensor=sensor)
    residual, raw = signals["wrench"][TARED], signals["raw"][TARED]
    raw = raw - raw.mean(axis=0)
    assert rms(raw[:, :3]) > 30.0
    assert rms(residual[:, :3]) < share * rms(raw[:, :3])
    assert rms(residual[:, 3:]) < share * rms(raw[:, 3:])


@pytest.mark.slow
def test_known_accelerations_are_as_good_and_weight_alone_is_not():
    results = {
        inertia: rms(
            run(
                "comau_racer_1_4",
                compensation=ToolCompensationParameters(inertia=inertia),
                amplitude=0.1,
                frequency=2.0,
            )["wrench"][TARED, :3]
        )
        for inertia in ("differentiated", "given", "none")
    }
    assert results["differentiated"] < 0.002 * results["none"]
    assert results["given"] < 0.002 * results["none"]


def test_taring_waits_until_the_force_is_steady():
    pulse = ForcePulse(0.0, 0.2, [0.0, 40.0, 0.0], ramp=0.1)
    signals = run("comau_racer_1_4", pulses=[pulse], duration=0.4)
    first = int(np.argmax(signals["tared"] > 0.0))
    assert 220 <= first <= 260
    assert not np.any(signals["wrench"][:first])
    assert rms(signals["wrench"][first:, :3]) < 0.6


@pytest.mark.slow(but="60.0-0")
@pytest.mark.parametrize(
    ("bias", "fault"), [(600.0, SensorFault.SATURATED), (60.0, SensorFault.NONE)]
)
def test_a_saturated_or_loaded_sensor_is_not_tared(bias, fault):
    sensor = ForceTorqueParameters(bias=np.array([bias, 0, 0, 0, 0, 0]), noise=np.zeros(6))
    signals = run("comau_racer_1_4", sensor=sensor, duration=0.2)
    assert not np.any(signals["tared"])
    assert not np.any(signals["wrench"])
    assert np.all(signals["fault"] == fault)


def test_a_sensor_at_the_end_of_its_range_is_not_tared_though_its_reading_is_steady():
    """It reads 12 N, a plausible bias, under any load; once tared, it would not measure a push."""
    sensor = ForceTorqueParameters(
        bias=np.array([30.0, 0, 0, 0, 0, 0]), noise=np.zeros(6), measurement_range=np.full(6, 12.0)
    )
    signals = run("comau_racer_1_4", sensor=sensor, duration=0.2)
    assert np.abs(signals["raw"]).max() == 12.0
    # the weight that it should read with it is not too much for a bias either
    assert ToolCompensationParameters().taring_bias[0] > 40.0
    assert not np.any(signals["tared"])
    assert not np.any(signals["wrench"])
