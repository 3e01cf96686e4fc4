"""Written models, read again by the robot readers, by Drake and by scenarios."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.tree import MultibodyForces

from diagrams.builder import build_station
from diagrams.robots.model import read_robot
from diagrams.scenario import RobotParameters, Scenario
from experiments.scenario_file import find_scenario
from identification.consistency.writing import write_model
from identification.model.base import random_motion
from identification.model.dynamic_parameters import parameter_names, true_parameters
from identification.model.regressor import Regressor
from identification.model.subject import load_subject
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.robot_parameters import load_parameters
from pfsc_drake.yaml.typed import load_file

ROBOTS = ["comau", "panda"]


def changed(subject, seed=0):
    """Return a consistent set that differs from the robot's own."""
    parameters = true_parameters(subject)
    random = np.random.default_rng(seed)
    factors = np.concatenate(
        [
            np.repeat(random.uniform(0.9, 1.2, subject.dimension), 10),
            random.uniform(0.8, 1.3, 3 * subject.dimension),
        ]
    )
    return parameters * factors


def torques_of_drake(file, motion):
    plant, _ = read_robot(RobotParameters(model=str(file)), Path())
    context, found = plant.CreateDefaultContext(), []
    for q, v, a in zip(*motion, strict=True):
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        found.append(plant.CalcInverseDynamics(context, a, forces))
    return np.array(found)


@pytest.mark.slow(but="comau")
@pytest.mark.parametrize("name", ROBOTS)
def test_is_loaded_with_the_same_parameters(name, request, tmp_path):
    subject = request.getfixturevalue(name)
    parameters = changed(subject)
    written = write_model(subject, parameters, tmp_path)
    for model in (tmp_path / f"{subject.name}.sdf", tmp_path / f"{subject.name}_elastic.sdf"):
        assert model in written.models
        again = load_subject(model)
        np.testing.assert_allclose(true_parameters(again), parameters, rtol=1e-9, atol=1e-12)
        assert again.joint_names == load_subject(model.stem).joint_names
    assert all(file.is_file() for file in written.files)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("suffix", ["sdf", "urdf"])
def test_inverse_dynamics_of_drake(name, suffix, request, tmp_path):
    """The tool acts beside; rotors are not coupled in Drake's models."""
    subject = request.getfixturevalue(name)
    parameters = changed(subject)
    write_model(subject, parameters, tmp_path)
    regressor = Regressor(subject, friction=False, coupling=False)
    motion = [x[:20] for x in random_motion(regressor)]
    change = (parameters - true_parameters(subject))[: regressor.size]
    expected = torques_of_drake(subject.name, motion) + regressor.matrix(*motion) @ change
    torques = torques_of_drake(tmp_path / f"{subject.name}.{suffix}", motion)
    np.testing.assert_allclose(torques, expected, atol=1e-9 * np.abs(expected).max())


def test_the_tool_is_taken_off_the_last_link(comau, tmp_path):
    carrying = load_subject("comau_racer_1_4", tool=True)
    write_model(carrying, true_parameters(carrying), tmp_path)
    again = load_subject(tmp_path / "comau_racer_1_4.sdf")
    np.testing.assert_allclose(true_parameters(again), true_parameters(comau), atol=1e-12)


def test_the_shipped_robot_stays(comau, tmp_path):
    write_model(comau, true_parameters(comau), tmp_path)
    again = load_subject(tmp_path / "comau_racer_1_4.sdf", tool=True)
    shipped = true_parameters(load_subject("comau_racer_1_4", tool=True))
    np.testing.assert_allclose(true_parameters(again), shipped, rtol=1e-12, atol=1e-14)


def test_delta_robot(delta, tmp_path):
    parameters = true_parameters(delta) * [1.1, 1.1, 1.1, 0.9, *[1.5] * 6]
    written = write_model(delta, parameters, tmp_path)
    again = load_subject(write_scenario(tmp_path, written.parameters))
    np.testing.assert_allclose(true_parameters(again), parameters, rtol=1e-12)


def write_scenario(folder, model):
    scenario = folder / "scenario.yaml"
    scenario.write_text(f"robot: {{model: {model}}}\n")
    return scenario


def test_bad_input(comau, delta, tmp_path):
    def refused(message, subject, parameters, folder=tmp_path):
        with pytest.raises(InputError, match=message):
            write_model(subject, parameters, folder)

    names, parameters = parameter_names(comau), true_parameters(comau)
    rotorless = np.where(np.arange(78) == names.index("joint_2.I_M"), 0.0, parameters)
    refused(r"joint_2.I_M = 0 kg m\^2; must be positive in a file", comau, rotorless)
    refused("not physically consistent: link_1: mass -", comau, -parameters)
    heavy = load_subject("comau_racer_1_4", tool=True)
    light = true_parameters(heavy)
    light[50:60] *= 0.5
    refused("link_6: mass -0.54.* kg without the tool", heavy, light)
    three = load_subject("comau_racer_1_4_3r")
    refused("3 joints; must be the 6 of comau_racer_1_4", three, true_parameters(three))
    uneven = true_parameters(delta) * [1.0, 1.1, 1.0, *[1.0] * 7]
    refused("slides of .*must be equal", delta, uneven)
    refused(
        "kg left for the plate beside", delta, true_parameters(delta) * [1, 1, 1, 0.3, *[1] * 6]
    )
    blocked = tmp_path / "file"
    blocked.write_text("")
    refused("file: cannot be made", comau, parameters, blocked)
    (tmp_path / "taken" / "parameters.yaml").mkdir(parents=True)
    refused("parameters.yaml: cannot be written", comau, parameters, tmp_path / "taken")


@pytest.fixture(scope="module")
def identified(comau, set_of_table, tmp_path_factory):
    folder = tmp_path_factory.mktemp("identified")
    return write_model(comau, set_of_table.parameters, folder)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pfc_comau_6r", "pfc_compliant_6r"])
def test_a_scenario_believes_what_was_identified(name, identified, comau):
    """The plant stays the true robot, with rigid as with elastic joints."""
    file = find_scenario(name)
    scenario = load_file(Scenario, file)
    scenario.model_error = Scenario().model_error
    true = build_station(scenario, file.parent)
    scenario.controller.model = str(identified.parameters)
    scenario.controller.friction.source = "model"
    scenario.controller.friction.nominal.file = str(identified.parameters)
    station = build_station(scenario, file.parent)
    nominal, own = station.part.nominal_model.robot, station.robot
    for link, plant_link in zip(own.links, true.robot.links, strict=True):
        assert link.mass == plant_link.mass
    without_tool_file = load_subject(identified.parameters.with_name("comau_racer_1_4.sdf"))
    for link, expected in zip(nominal.links[:5], without_tool_file.chain.links, strict=False):
        assert link.mass == pytest.approx(expected.mass, rel=1e-9)
        np.testing.assert_allclose(link.I_C, expected.I_C, atol=1e-9)
    tool = own.links[5].mass - comau.chain.links[5].mass
    assert nominal.links[5].mass == pytest.approx(without_tool_file.chain.links[5].mass + tool)
    np.testing.assert_array_equal(nominal.gather("stiffness"), own.gather("stiffness"))


@pytest.mark.slow
def test_a_scenario_takes_the_written_robot(identified):
    file = find_scenario("pfc_comau_6r")
    scenario = load_file(Scenario, file)
    scenario.model_error = Scenario().model_error
    scenario.robot.model = str(identified.parameters.with_name("comau_racer_1_4_elastic.sdf"))
    station = build_station(scenario, file.parent)
    masses = [link.mass for link in load_parameters(identified.parameters).links]
    np.testing.assert_allclose(station.robot.gather("mass")[:5], masses[:5], rtol=1e-9)


@pytest.mark.slow
def test_a_scenario_believes_an_identified_delta_robot(delta, tmp_path):
    parameters = true_parameters(delta) * [1.1, 1.1, 1.1, 0.9, *[1.5] * 6]
    written = write_model(delta, parameters, tmp_path)
    file = find_scenario("pfc_delta")
    scenario = load_file(Scenario, file)
    scenario.model_error = Scenario().model_error
    scenario.controller.model = str(written.parameters)
    station = build_station(scenario, file.parent)
    masses = station.part.nominal_model.robot.parameters.masses
    assert masses.effective_slide == pytest.approx(parameters[0])
    assert masses.effective_plate == pytest.approx(parameters[3])
    assert station.robot.parameters.masses.effective_slide == pytest.approx(parameters[0] / 1.1)
