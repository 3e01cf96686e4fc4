"""Rigid models made elastic, against a model that was written elastic, and against (2.65)."""

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from pfsc_drake.robot.models.elastic_joints import ElasticJoints
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.models.reading import ModelOptions, read_model
from pfsc_drake.robot.models.robot_parameters import load_parameters
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant


def chain_of(plant, tool):
    return chain_from_plant(plant, plant.GetFrameByName(tool))


@pytest.fixture(scope="module", name="comaus")
def fixture_comaus():
    """The shipped elastic robot, and the rigid one made elastic."""
    written = MultibodyPlant(0.0)
    read_model(written, resolve_model("comau_racer_1_4_elastic"))
    parameters = load_parameters("comau_racer_1_4")
    result = MultibodyPlant(0.0)
    joints = parameters.elasticities["elastic_6r"]
    elastic = ElasticJoints(
        joints.stiffness,
        joints.damping,
        parameters.rotors.inertia,
        parameters.rotors.gear_ratio,
    )
    read_model(result, resolve_model("comau_racer_1_4"), ModelOptions(elastic=elastic))
    return written, result


def test_the_chain_of_a_model_that_was_written_elastic(comaus):
    (written, _), (result, _) = (chain_of(plant, "tool_point") for plant in comaus)
    assert result.names == [f"joint_{i}" for i in range(1, 7)]
    assert result.is_elastic
    for attribute in (
        *("R_PF", "p_PF", "axis", "mass", "p_LC", "I_C", "reflected_inertia", "stiffness"),
        *("damping", "effort_limit", "position_limits", "velocity_limit"),
    ):
        np.testing.assert_allclose(
            result.gather(attribute), written.gather(attribute), rtol=1e-12, atol=1e-12
        )
    np.testing.assert_allclose(result.p_LT, written.p_LT, atol=1e-14)


def moved(plant, torque, duration):
    """Return ``[q_J, v_J, q_M, v_M]`` after constant drive torques from a posture at rest."""
    _, coordinates = chain_of(plant, "tool_point")
    builder = DiagramBuilder()
    builder.AddSystem(plant)
    actuation = np.zeros(6)
    actuation[coordinates.actuators] = torque
    source = builder.AddSystem(ConstantVectorSource(actuation))
    builder.Connect(source.get_output_port(), plant.get_actuation_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    integrator = ResetIntegratorFromFlags(simulator, "runge_kutta5", 5e-4)
    integrator.set_fixed_step_mode(True)
    root = simulator.get_mutable_context()
    context = plant.GetMyMutableContextFromRoot(root)
    posture = np.array([0.3, 1.9, -0.6, 0.2, 1.2, -0.4])
    start = np.concatenate([posture, np.zeros(6), posture, np.zeros(6)])
    plant.SetPositionsAndVelocities(context, coordinates.plant_state(start))
    simulator.AdvanceTo(duration)
    x = plant.GetPositionsAndVelocities(context)
    return np.concatenate([coordinates.link_rows @ x, coordinates.motor_rows @ x])


def test_the_motion_of_a_model_that_was_written_elastic(comaus):
    torque = np.array([50.0, -300.0, 200.0, 3.0, -5.0, 1.0])
    written, result = (moved(plant, torque, 0.2) for plant in comaus)
    np.testing.assert_allclose(result, written, atol=1e-8)
    assert np.abs(result[:6] - result[12:18]).max() > 1e-3  # the joints do bend


@pytest.fixture(name="elastic")
def fixture_elastic(write, read, urdf_parts):
    """Read a model of two axes and a slide with elastic joints."""
    urdf, link, joint = urdf_parts
    limit = '<limit lower="-0.5" upper="0.5" effort="100" velocity="1"/>'
    text = urdf(link("plate"), joint("lift", "tcp", "plate", limit, "prismatic"))
    file = write(text.replace("</joint>", '<dynamics damping="0.7"/></joint>', 1))

    def call(**parameters):
        arrays = {key: np.array(value, dtype=float) for key, value in parameters.items()}
        return read(file, elastic=ElasticJoints(**arrays))[0]

    return call


def test_one_number_or_one_for_each(elastic):
    plant = elastic(
        stiffness=[4e3, np.inf, 2e4],
        damping=[3.0],
        rotor_inertia=[1e-4, 2e-4, 3e-4],
        gear_ratio=[50.0],
    )
    chain, coordinates = chain_of(plant, "plate")
    assert chain.names == ["shoulder", "elbow", "lift"]
    np.testing.assert_array_equal(chain.K_s, [4e3, np.inf, 2e4])
    np.testing.assert_array_equal(chain.K_d, [3.0, 0.0, 3.0])
    np.testing.assert_allclose(chain.D_M, [0.25, 0.5, 0.75], rtol=1e-12)
    assert chain.gather("effort_limit").tolist() == [30.0, 30.0, 100.0]
    assert chain.gather("velocity_limit").tolist() == [1.5, 1.5, 1.0]
    assert coordinates.num_states == 10
    # the model's own damping stays with the motor
    assert plant.GetJointByName("shoulder").default_damping_vector() == [0.7]
    # nothing weighs more than before
    rigid, _ = chain_of(elastic(), "plate")
    for attribute in ("mass", "p_LC", "I_C"):
        np.testing.assert_allclose(chain.gather(attribute), rigid.gather(attribute), atol=1e-14)


def test_kinetic_energy_is_that_of_the_reduced_model(elastic):
    """``v_J' D_E v_J + v_M' D_M v_M``, as (2.65) says, slides too."""
    rotors = {"rotor_inertia": [1e-4, 2e-4, 3.0], "gear_ratio": [50.0, 40.0, 1.0]}
    plant = elastic(stiffness=[4e3], **rotors)
    rigid = elastic()
    chain, coordinates = chain_of(plant, "plate")
    _, rigid_coordinates = chain_of(rigid, "plate")
    joint_state = np.random.default_rng(1).uniform(-0.4, 0.4, 12)
    q_J, v_J, _, v_M = joint_state.reshape(4, 3)
    context, rigid_context = plant.CreateDefaultContext(), rigid.CreateDefaultContext()
    plant.SetPositionsAndVelocities(context, coordinates.plant_state(joint_state))
    still = np.concatenate([q_J, v_J, q_J, v_J])
    rigid.SetPositionsAndVelocities(rigid_context, rigid_coordinates.plant_state(still))
    energy = 2.0 * (rigid.CalcKineticEnergy(rigid_context)) + chain.D_M @ v_M**2
    assert 2.0 * plant.CalcKineticEnergy(context) == pytest.approx(energy, rel=1e-12)


def test_rotors_of_rigid_joints(elastic):
    chain, _ = chain_of(elastic(rotor_inertia=[1e-4], gear_ratio=[100.0]), "plate")
    np.testing.assert_allclose(chain.D_M, 1.0)
    assert not chain.is_elastic


@pytest.mark.parametrize(
    ("parameters", "parts"),
    [
        ({"stiffness": [-1.0]}, ["elastic.stiffness = [-1.0]", ".inf"]),
        ({"stiffness": [0.0]}, ["elastic.stiffness = [0.0]", ".inf"]),
        ({"damping": [-1.0]}, ["elastic.damping", "from 0"]),
        ({"damping": [np.inf]}, ["elastic.damping", "finite"]),
        ({"rotor_inertia": [np.nan]}, ["elastic.rotor_inertia", "finite"]),
        ({"gear_ratio": [0.0]}, ["elastic.gear_ratio", "numbers from"]),
        ({"stiffness": [1e3, 1e3], "rotor_inertia": [1.0]}, ["elastic.stiffness: 2 values"]),
        ({"stiffness": [1e3]}, ["elastic.rotor_inertia: joint 'shoulder' has none", "positive"]),
    ],
)
def test_numbers_that_do_not_fit(elastic, refused, parameters, parts):
    refused(lambda: elastic(**parameters), *parts)


def test_a_model_that_is_elastic_already(refused):
    options = ModelOptions(elastic=ElasticJoints(stiffness=np.array([1e3])))
    file = resolve_model("comau_racer_1_4_elastic_3r")
    refused(lambda: read_model(MultibodyPlant(0.0), file, options), "elastic already", "'flex_1'")


def test_joint_damping_goes_by_the_chain(elastic, tmp_path, read):
    """The sprung joints of a file that lists them from the tool to the base."""
    text = resolve_model("comau_racer_1_4_elastic_3r").read_text(encoding="utf-8")
    begin, end = text.index("    <joint name="), text.index("  </model>")
    body = text[begin:end]
    parts = [f"    <joint name={part}" for part in body.split("    <joint name=")[1:]]
    joints = [part[: part.index("</joint>") + 9] for part in parts]
    rest = body
    for joint in joints:
        rest = rest.replace(joint, "")
    file = tmp_path / "backwards.sdf"
    file.write_text(text[:begin] + rest + "".join(reversed(joints)) + text[end:], encoding="utf-8")
    plant = read(file, joint_damping=[10.0, 20.0, 30.0])[0]
    order = [plant.get_joint(i).name() for i in plant.GetJointIndices()]
    assert order.index("flex_3") < order.index("flex_1")
    assert chain_of(plant, "tool_point")[0].K_d.tolist() == [10.0, 20.0, 30.0]
