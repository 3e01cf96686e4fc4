"""The controller of a station depends on measurements and its nominal model only."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.primitives import (
    Adder,
    ConstantVectorSource,
    Demultiplexer,
    MatrixGain,
    Multiplexer,
    ZeroOrderHold,
)

from diagrams.builder import build_station
from diagrams.scenario import EncoderOptions
from experiments.scenario_file import find_scenario
from pfsc_drake.blocks import wiring_blocks
from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.law.safe_stop import SafeStop
from pfsc_drake.control.manifolds.manifold import ToolKinematics
from pfsc_drake.errors import InputError
from pfsc_drake.systems.block_system import BlockSystem

WIRES = (Adder, ConstantVectorSource, Demultiplexer, MatrixGain, Multiplexer, ZeroOrderHold)
# what a real machine gives: positions and velocities of the joints, and a sensor's reading
MEASUREMENTS = {"joint_encoders", "encoder_increments", "sensor_failure", "force_torque_sensor"}
SCENARIOS = (
    "pfc_elastic_6r",
    "ttc_comau_6r",
    "pfc_comau_6r_elastic",
    "operator_hand_6r",
    "friction_observer_in_loop",
    "pfc_delta_notch",
)


def _build(settings, **robot):
    for key, value in robot.items():
        setattr(settings.robot, key, value)
    settings.simulation.fused = False
    return build_station(settings, find_scenario("pfc_delta").parent)


# systems that control
CONTROL = ("controller", "velocity_servo")


def _is_wire(system):
    if isinstance(system, BlockSystem):
        return type(system.block).__module__ == wiring_blocks.__name__
    return isinstance(system, WIRES) and system.get_name() not in MEASUREMENTS


def _crossings(station):
    """Return the systems that controlling ones read and that do not control, wires passed."""
    sources = {}
    for (system, _), (source, _) in station.diagram.connection_map().items():
        sources.setdefault(system.get_name(), []).append(source)
    found = set()

    def follow(name):
        for source in sources.get(name, []):
            if _is_wire(source):
                follow(source.get_name())
            elif source.get_name() not in CONTROL:
                found.add(source.get_name())

    for name in CONTROL:
        follow(name)
    return found


@pytest.mark.slow(but="pfc_delta_notch")
@pytest.mark.parametrize("name", SCENARIOS)
def test_only_measurements_reach_the_controller(load_scenario, name):
    settings = load_scenario(name)
    station = _build(settings)
    crossings = _crossings(station)
    assert crossings <= MEASUREMENTS
    encoders = settings.encoders != EncoderOptions()
    assert ("encoder_increments" if encoders else "joint_encoders") in crossings
    assert ("force_torque_sensor" in crossings) == station.diagram.HasSubsystemNamed(
        "force_torque_sensor"
    )
    for system in station.diagram.GetSubsystemByName("controller").GetSystems():
        assert not isinstance(system, MultibodyPlant)


@pytest.mark.slow
def test_a_posture_yields_to_what_is_observed_of_forces(load_scenario):
    """Told of them, the law knew what no machine measures."""
    settings = load_scenario("pfc_elbow_7r")
    crossings = _crossings(_build(settings))
    assert crossings - MEASUREMENTS == {"link_forces"}
    settings.controller.posture.yields = "observed"
    settings.controller.external_torque.source = "observed"
    station = _build(settings)
    assert _crossings(station) <= MEASUREMENTS
    controller = station.diagram.GetSubsystemByName("controller")
    reads = [
        source.get_name()
        for (system, _), (source, _) in controller.connection_map().items()
        if system.get_name() == "posture_reference"
    ]
    assert len(reads) == 3


@pytest.mark.slow
def test_the_walk_finds_known_forces(load_scenario):
    settings = load_scenario("pfc_comau_6r_elastic")
    settings.controller.external_torque.source = "known"
    assert _crossings(_build(settings)) - MEASUREMENTS == {"hold_back"}


def _outputs(system, seed):
    """Return all outputs of a system for random inputs."""
    context, random = system.CreateDefaultContext(), np.random.default_rng(seed)
    for i in range(system.num_input_ports()):
        port = system.get_input_port(i)
        port.FixValue(context, random.uniform(-0.5, 0.5, port.size()))
    return np.concatenate(
        [system.get_output_port(i).Eval(context) for i in range(system.num_output_ports())]
    )


def _controlling(station):
    diagram = station.diagram
    systems = [*diagram.GetSubsystemByName("controller").GetSystems(), *diagram.GetSystems()]
    # a projector knows no robot
    return {
        system.get_name(): system
        for k, system in enumerate(systems)
        if (k < len(systems) - len(diagram.GetSystems()) or system.get_name() in CONTROL[1:])
        and "projector" not in system.get_name()
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "law"),
    [
        ("pfc_elastic_6r", "elastic"),
        ("pfc_comau_6r_elastic", "elastic"),
        ("pfc_compliant_6r", "rigid"),
        ("pfc_compliant_6r", "velocity_servo"),
    ],
)
def test_the_controller_uses_the_nominal_model(load_scenario, tmp_path, name, law):
    """A station that believes robot B of robot A controls as one whose robot is B."""
    settings = load_scenario(name)
    settings.controller.law = law
    model = settings.robot.model
    truth = _controlling(_build(settings))
    other = _heavier(model, tmp_path)
    settings.controller.model = str(other)
    believing = _controlling(_build(settings))
    settings.controller.model = ""
    exact = _controlling(_build(settings, model=str(other)))
    assert truth.keys() == believing.keys() == exact.keys()
    concerned = set()
    for system in believing:
        ours = _outputs(believing[system], 5)
        # gains of servos are for the start posture, which is the plant's; the models share it
        np.testing.assert_array_equal(ours, _outputs(exact[system], 5), err_msg=system)
        if not np.array_equal(ours, _outputs(truth[system], 5), equal_nan=True):
            concerned.add(system)
    assert ("velocity_servo" if law == "velocity_servo" else "following_controller") in concerned
    if "tool_compensation" in believing:
        assert "tool_compensation" in concerned


def _heavier(model, folder):
    """Write a model like a shipped one with heavier links, and return its file."""
    from pfsc_drake.robot.models.robot_parameters import load_parameters
    from pfsc_drake.robot.models.writer import write_sdf

    robot = load_parameters("comau_racer_1_4")
    for body in [*robot.links, robot.tool]:
        body.mass, body.inertia = 1.2 * body.mass, 1.2 * body.inertia
    variant = next(v for v in robot.variants if v.name == model)
    file = folder / "heavier.sdf"
    file.write_text(write_sdf(robot, variant), encoding="utf-8")
    return file


@pytest.mark.slow
def test_the_safe_state_holds_the_nominal_weight(load_scenario):
    settings = load_scenario("pfc_elastic_6r")
    true = _build(settings)
    settings.model_error.mass = [0.5]
    light = _build(settings)
    rest, nothing = np.zeros(6), np.full(24, np.nan)

    def weight(station):
        """Return the torque of a robot at rest that does not see its joints."""
        law, q = station.law, station.start_posture
        stop = Stepper(SafeStop(law.robot, law.limits, law.safe_state, 1e-3))
        state = np.concatenate([q, rest, q, rest])
        stop.step(joint_state=state, fault=0.0, suspects=np.zeros(24))
        return stop.step(joint_state=nothing, fault=1.0, suspects=np.zeros(24))["torque"]

    np.testing.assert_allclose(weight(light), 0.5 * weight(true), rtol=1e-9)
    # where the robot stands, and what is logged of it, is the plant's
    np.testing.assert_array_equal(light.initial_state, true.initial_state)
    assert light.robot.links[0].mass == true.robot.links[0].mass


@pytest.mark.slow
def test_parameters_of_another_robot_as_nominal_model(load_scenario):
    settings = load_scenario("pfc_elastic_6r")
    plain = _build(settings)
    settings.controller.model = str(Path("../../models/comau_racer_1_4/parameters.yaml"))
    same = _build(settings)
    assert same.part.nominal_model.robot is not same.robot
    for ours, theirs in zip(same.part.nominal_model.robot.links, plain.robot.links, strict=True):
        assert ours.mass == pytest.approx(theirs.mass)
        np.testing.assert_allclose(ours.I_C, theirs.I_C, atol=1e-12)
        assert ours.stiffness == theirs.stiffness


@pytest.mark.parametrize(
    ("name", "key", "value", "message"),
    [
        ("pfc_elastic_6r", "model", "nothing", r"^controller\.model: robot model 'nothing'"),
        ("pfc_elastic_6r", "model", "comau_racer_1_4_3r", r"^controller\.model = .* the joints"),
        ("pfc_delta", "model", "comau_racer_1_4", r"^controller\.model = .*DELTA robot"),
        ("pfc_delta", "tool_mass", -9.0, r"^model_error\.tool_mass = -9 kg; allowed: -"),
        ("pfc_elastic_6r", "tool_mass", -9.0, r"^model_error\.tool_mass = -9 kg; allowed: more"),
        ("pfc_elastic_6r", "mass", [1.0] * 5, r"^model_error\.mass: 5 values"),
    ],
)
def test_invalid_nominal_models(load_scenario, name, key, value, message):
    settings = load_scenario(name)
    setattr(settings.controller if key == "model" else settings.model_error, key, value)
    with pytest.raises(InputError, match=message):
        _build(settings)


@pytest.mark.slow
def test_errors_of_kinematics(load_scenario):
    settings = load_scenario("pfc_elastic_6r")
    settings.model_error.mass = [0.9]
    assert _build(settings).part.nominal_model.has_actual_kinematics
    settings.model_error.joint_offset_deg = [0.1]
    station = _build(settings)
    assert not station.part.nominal_model.has_actual_kinematics
    controller = station.diagram.GetSubsystemByName("controller")
    kinematics = controller.GetSubsystemByName("tool_kinematics")
    assert isinstance(kinematics.block, ToolKinematics)
