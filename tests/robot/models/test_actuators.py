"""Actuators that a user's plant lacks: effort limits of the model, every torque at its joint."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake import add_actuators
from pfsc_drake.robot.models.reading import read_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant

ELBOW = (
    '<transmission type="SimpleTransmission"><joint name="elbow"/><actuator name="m"/>'
    "</transmission>"
)
DOOR = (
    '<robot name="door"><link name="frame"/><link name="leaf"><inertial><mass value="3"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    '<joint name="hinge" type="continuous"><parent link="frame"/><child link="leaf"/>'
    '<axis xyz="0 0 1"/></joint></robot>'
)


@pytest.fixture(name="arm")
def fixture_arm(write, urdf_parts):
    """A model whose shoulder has 70 Nm and no transmission, whose elbow has 30 Nm and one."""
    urdf, _, _ = urdf_parts
    return write(urdf(ELBOW).replace('effort="30"', 'effort="70"', 1))


@pytest.fixture(name="plant")
def fixture_plant(arm):
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(arm))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link"))
    return plant


def limits(plant):
    actuators = [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices()]
    return {actuator.joint().name(): actuator.effort_limit() for actuator in actuators}


def test_what_is_missing_is_added_as_scenarios_do(arm, plant):
    assert limits(plant) == {"elbow": 30.0}
    (added,) = add_actuators(plant, arm)
    assert added.joint().name() == "shoulder"
    assert add_actuators(plant, arm) == []
    plant.Finalize()
    other = MultibodyPlant(0.0)
    read_model(other, arm)
    assert limits(plant) == limits(other) == {"shoulder": 70.0, "elbow": 30.0}


def test_every_torque_acts_on_its_joint(arm, plant, write):
    """Though the elbow's actuator is first, behind that of another model."""
    door = write(DOOR, "door.urdf")
    Parser(plant).AddModels(str(door))
    add_actuators(plant, door)
    add_actuators(plant, arm)
    plant.Finalize()
    _, coordinates = chain_from_plant(plant, plant.GetFrameByName("tcp"))
    tau = np.array([5.0, -3.0])
    forces = plant.MakeActuationMatrix() @ coordinates.actuation_rows(plant.num_actuators()) @ tau
    joints = [plant.GetJointByName(name) for name in ("shoulder", "elbow", "hinge")]
    assert [forces[joint.velocity_start()] for joint in joints] == [5.0, -3.0, 0.0]
    assert coordinates.actuators.tolist() == [2, 0]


def test_only_joints_of_the_model_are_driven(arm, plant, write):
    Parser(plant).AddModels(str(write(DOOR, "door.urdf")))
    add_actuators(plant, arm)
    assert limits(plant) == {"shoulder": 70.0, "elbow": 30.0}


def test_joints_that_mimic_others_are_left_alone(write, urdf_parts):
    urdf, urdf_link, urdf_joint = urdf_parts
    mimic = '<limit lower="0" upper="1" effort="4" velocity="1"/><mimic joint="elbow"/>'
    file = write(urdf(urdf_link("finger"), urdf_joint("grip", "tcp", "finger", mimic)))
    plant = MultibodyPlant(1e-3)
    Parser(plant).AddModels(str(file))
    add_actuators(plant, file)
    assert limits(plant) == {"shoulder": 30.0, "elbow": 30.0}
    add_actuators(plant, file, ["grip"])
    assert limits(plant)["grip"] == 4.0


def test_limits_and_joints_of_ones_own(write, urdf_text):
    """Public models with effort 0 are many."""
    file = write(urdf_text.replace('effort="30"', 'effort="0"'))
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(file))
    add_actuators(plant, file, ["shoulder"], effort_limits={"shoulder": 12.0})
    assert limits(plant) == {"shoulder": 12.0}


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"joints": ["sholder"]}, ("joints: 'sholder'", "shoulder, elbow", "did you mean")),
        ({"joints": ["flange"]}, ("joints: 'flange'", "allowed: shoulder, elbow")),
        ({"effort_limits": {"elbow": 5.0}}, ("effort_limits: 'elbow'", "allowed: shoulder")),
        ({"effort_limits": {"shoulder": 0.0}}, ("effort_limits: shoulder = 0.0", "positive")),
        ({"effort_limits": {"shoulder": np.nan}}, ("effort_limits: shoulder = nan", "positive")),
    ],
)
def test_what_is_refused(arm, plant, refused, given, words):
    refused(lambda: add_actuators(plant, arm, **given), *words)
    assert limits(plant) == {"elbow": 30.0}


def test_an_effort_of_zero_is_refused(write, urdf_text, refused):
    file = write(urdf_text.replace('effort="30"', 'effort="0"', 1))
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(file))
    refused(lambda: add_actuators(plant, file), file, "'shoulder'", "effort = 0")


def test_a_finalized_plant_is_refused(arm, plant, refused):
    plant.Finalize()
    refused(lambda: add_actuators(plant, arm), "plant: is finalized", "before Finalize()")
