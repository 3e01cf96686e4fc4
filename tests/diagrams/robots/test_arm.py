"""Arms whose model the scenario changes: rotor coupling (2.64) and joint damping."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from diagrams.builder import build_station
from diagrams.scenario import JointFrictionParameters, RobotParameters, Scenario
from experiments.results.recorded_motion import collect_motion
from experiments.results.run_signals import collect_log
from experiments.simulation import simulate
from pfsc_drake.errors import InputError
from pfsc_drake.physics.scripted_force import ForcePulse
from pfsc_drake.systems.plants.coupled_plants import FullElasticPlant
from tests.scenarios import LONG

COMAU = "comau_racer_1_4"


@pytest.fixture
def settings(load_scenario) -> Scenario:
    """Three elastic axes; a law that is compiled fast."""
    settings = load_scenario("pfc_elastic_3r")
    settings.controller.law = "singular_perturbation"
    return settings


@pytest.fixture
def coupled(settings):
    settings.robot.rotor_coupling = COMAU
    return settings


def run(settings, duration):
    settings.simulation.fused = duration >= LONG
    station = build_station(settings, Path())
    result = simulate(station, settings.simulation, duration, lambda *_: None)
    assert result.fault is None
    return station, result.root, collect_log(station, result.root)


def uncoupled_parameters(folder):
    """Write parameters with rotors on the base, which does not turn."""
    text = (Path("models") / COMAU / "parameters.yaml").read_text(encoding="utf-8")
    path = folder / "uncoupled.yaml"
    on_base = text.replace("[1, 1, 3, 3, 4, 5]", "[0, 0, 0, 0, 0, 0]")
    assert on_base != text
    path.write_text(on_base, encoding="utf-8")
    return path


@pytest.mark.slow
def test_rotors_on_the_base_make_no_difference(settings, tmp_path):
    """All connections of the other plant: drives, friction, a force on the tool, start."""
    settings.start.offset = [0.005, 0.0]
    settings.friction = JointFrictionParameters(f_c=[20.0, 20.0, 10.0], f_v=[5.0, 5.0, 5.0])
    settings.forces = [ForcePulse(0.05, 0.2, np.array([30.0, -40.0, 50.0]), ramp=0.02)]
    _, _, expected = run(settings, 0.25)
    settings.robot.rotor_coupling = str(uncoupled_parameters(tmp_path))
    station, _, got = run(settings, 0.25)
    assert isinstance(station.part.plant, FullElasticPlant)
    assert expected.signals.keys() == got.signals.keys()
    assert np.ptp(expected["q_J"].values, axis=0).max() > 1e-3
    for name in ("q_J", "v_J", "q_M", "v_M", "tau_d", "tau_J", "tau_f", "tau_ext", "xi"):
        scale = np.abs(expected[name].values).max()
        # the wrench follows the joints within a step here, and is applied to a body there
        tolerance = 1e-6 * scale
        np.testing.assert_allclose(got[name].values, expected[name].values, rtol=0, atol=tolerance)


@pytest.mark.slow
def test_the_coupling_disturbs_the_elastic_law(settings):
    """The exact law of the simplified model is not exact any more, but far from failing."""
    settings.controller.law = "elastic"
    deviation = {}
    for rotors in ("", COMAU):
        settings.robot.rotor_coupling = rotors
        _, _, log = run(settings, 1.0)
        xi = np.linalg.norm(log["xi"].values, axis=1)
        deviation[rotors] = xi[log.time > 0.35].max()
    assert deviation[""] < 2e-5
    assert 5.0 * deviation[""] < deviation[COMAU] < 5e-4


@pytest.mark.slow
def test_the_coupling_hardly_matters_to_singular_perturbation(settings):
    """What that law neglects anyway is a hundred times as much."""
    deviation = {}
    for rotors in ("", COMAU):
        settings.robot.rotor_coupling = rotors
        _, _, log = run(settings, 1.0)
        deviation[rotors] = np.linalg.norm(log["xi"].values[log.time > 0.35], axis=1)
    assert deviation[""].max() > 3e-3
    change = np.abs(deviation[COMAU] - deviation[""]).max()
    assert 1e-5 < change < 0.05 * deviation[""].max()


@pytest.mark.slow
def test_start_and_replay(coupled):
    station, root, log = run(coupled, 0.05)
    assert np.abs(log["v_J"].values[0]).max() < 1e-15
    np.testing.assert_allclose(log["xi"].values[0], [0.01, 0.0], atol=1e-9)
    motion = collect_motion(station, root, 0.01, log, 0.0)
    model = station.part.model
    context = model.CreateDefaultContext()
    for positions, pose in zip(motion.positions, motion.tool_pose, strict=True):
        model.SetPositions(context, positions)
        y_t = station.part.tool.CalcPoseInWorld(context).translation()
        np.testing.assert_allclose(y_t, pose[:3], atol=1e-12)


@pytest.mark.parametrize(
    ("model", "rotors", "part"),
    [
        ("comau_racer_1_4_3r", COMAU, "must have finite stiffness"),
        ("comau_racer_1_4_elastic_3r", "nobody", "must be a file or one of"),
        ("comau_racer_1_4_elastic_3r", "none.yaml", "none.yaml"),
    ],
)
def test_robots_that_cannot_be_coupled(settings, model, rotors, part):
    settings.controller.law = "rigid"
    settings.robot.model, settings.robot.rotor_coupling = model, rotors
    with pytest.raises(InputError, match=part) as caught:
        build_station(settings, Path())
    assert str(caught.value).startswith("robot.rotor_coupling: ")


@pytest.mark.slow
def test_the_sensor_of_the_full_model_reads_the_load_of_a_joint(settings, tmp_path):
    """With rotors on the base both plants move alike; one tells its reactions, the other not."""
    settings.controller.external_torque.source = "measured"
    settings.forces = [ForcePulse(0.05, 0.2, np.array([30.0, -40.0, 50.0]), ramp=0.02)]
    _, _, expected = run(settings, 0.25)
    settings.robot.rotor_coupling = str(uncoupled_parameters(tmp_path))
    _, _, got = run(settings, 0.25)
    force = expected["wrench_measured"].values
    assert np.abs(force).max() > 40.0
    np.testing.assert_allclose(got["wrench_measured"].values, force, rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    ("joint", "said"), [("nowhere", r"'nowhere'; allowed: .*motor_2"), ("motor_2", "motor_2")]
)
def test_a_sensor_needs_its_joint(coupled, joint, said):
    coupled.controller.external_torque.source = "measured"
    coupled.sensor.joint = joint
    coupled.forces = [ForcePulse(0.05, 0.2, np.array([30.0, -40.0, 50.0]), ramp=0.02)]
    with pytest.raises(InputError, match=said):
        build_station(coupled, Path())


@pytest.mark.slow
def test_joint_damping_is_the_models_but_for_its_damping(settings, load_arm):
    settings.controller.law = "elastic"
    settings.robot.joint_damping = [10.0, 20.0, 30.0]
    station = build_station(settings, Path())
    np.testing.assert_array_equal(station.robot.K_d, [10.0, 20.0, 30.0])
    arm = load_arm(settings.robot.model)
    np.testing.assert_array_equal(arm.chain.K_d, np.zeros(3))
    for ours, theirs in zip(station.robot.links, arm.chain.links, strict=True):
        for field in dataclasses.fields(ours):
            if field.name != "damping":
                value = getattr(theirs, field.name)
                np.testing.assert_array_equal(getattr(ours, field.name), value)
    # the plant has it too, axis by axis
    damped, undamped = station.part.plant, arm.plant
    x = station.initial_state.copy()
    x[damped.num_positions() :] = 0.1 * np.arange(1.0, 7.0)
    torques = []
    for plant in (damped, undamped):
        context = plant.CreateDefaultContext()
        plant.SetPositionsAndVelocities(context, x)
        plant.get_actuation_input_port().FixValue(context, np.zeros(3))
        a = plant.EvalTimeDerivatives(context).CopyToVector()[6:]
        # M a = forces; M is the same
        torques.append(plant.CalcMassMatrix(context) @ a)
    flex = [damped.GetJointByName(f"flex_{i}").velocity_start() for i in (1, 2, 3)]
    expected = np.zeros(6)
    expected[flex] = -np.array([10.0, 20.0, 30.0]) * x[6:][flex]
    np.testing.assert_allclose(torques[0] - torques[1], expected, atol=1e-8)


@pytest.mark.parametrize(
    ("model", "damping", "part"),
    [
        ("comau_racer_1_4_elastic_3r", [1.0], "1 values; .* has 3 elastic joints"),
        ("comau_racer_1_4_3r", [1.0, 1.0, 1.0], "3 values; .* has 0 elastic joints"),
    ],
)
def test_joint_damping_of_another_robot(settings, model, damping, part):
    settings.robot.model, settings.robot.joint_damping = model, damping
    with pytest.raises(InputError, match=rf"robot\.joint_damping: {part}"):
        build_station(settings, Path())


@pytest.mark.parametrize("damping", [[-1.0, 1.0, 1.0], [np.nan, 1.0, 1.0], [np.inf]])
def test_joint_damping_out_of_range(damping):
    with pytest.raises(InputError, match=r"joint_damping = .*finite numbers, none negative"):
        RobotParameters(joint_damping=damping)


@pytest.mark.slow
def test_the_visco_elastic_law_converges(load_scenario):
    settings = load_scenario("pfc_viscoelastic_3r")
    _, _, log = run(settings, 1.6)
    xi = np.linalg.norm(log["xi"].values, axis=1)
    assert xi[0] == pytest.approx(0.01, abs=1e-9)
    assert xi[log.time > 0.5].max() < 2e-5
    assert np.abs(log["eta_dot"].values).max() > 0.9
