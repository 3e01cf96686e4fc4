"""Joint resonances against a closed form and against the plant's own linearization."""

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.robot_model import joint_resonances
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.robot.serial.links import ChainLink


def test_two_masses_and_a_spring():
    link = ChainLink(
        name="slide",
        kind="prismatic",
        R_PF=np.eye(3),
        p_PF=np.zeros(3),
        axis=np.array([0.0, 0.0, 1.0]),
        mass=2.0,
        p_LC=np.zeros(3),
        I_C=np.eye(3),
        reflected_inertia=3.0,
        stiffness=120.0,
    )
    expected = np.sqrt(120.0 * (1.0 / 2.0 + 1.0 / 3.0))
    assert np.allclose(joint_resonances(SerialChain((link,)), np.zeros(1)), expected)


def test_six_axes_oscillate_as_drake_says():
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4_elastic")))
    plant.Finalize()
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
    chain, coordinates = chain_from_plant(plant, plant.GetFrameByName("tool_point"))
    q = np.deg2rad([20.0, 100.0, -20.0, 10.0, 80.0, -15.0])
    context = plant.CreateDefaultContext()
    rest = np.zeros(6)
    x = coordinates.plant_state(np.concatenate([q, rest, q, rest]))
    plant.SetPositionsAndVelocities(context, x)
    plant.get_actuation_input_port().FixValue(context, np.zeros(6))
    step, columns = 1e-5, []
    for i in range(12):
        slopes = []
        for sign in (1.0, -1.0):
            moved = x.copy()
            moved[i] += sign * step
            plant.SetPositionsAndVelocities(context, moved)
            slopes.append(plant.EvalTimeDerivatives(context).CopyToVector()[12:])
        columns.append((slopes[0] - slopes[1]) / (2.0 * step))
    squares = -np.linalg.eigvals(np.column_stack(columns)).real
    expected = np.sqrt(np.sort(squares)[6:])
    assert np.allclose(joint_resonances(chain, q), expected, rtol=1e-6)


def test_a_rigid_joint_carries_its_rotor():
    """Two slides in line, the first rigid: its rotor, links and the elastic one's rotor."""

    def slide(mass, rotor, stiffness):
        return ChainLink(
            name="slide",
            kind="prismatic",
            R_PF=np.eye(3),
            p_PF=np.zeros(3),
            axis=np.array([0.0, 0.0, 1.0]),
            mass=mass,
            p_LC=np.zeros(3),
            I_C=np.eye(3),
            reflected_inertia=rotor,
            stiffness=stiffness,
        )

    chain = SerialChain((slide(4.0, 7.0, np.inf), slide(2.0, 3.0, 120.0)))
    # x the rigid slide, y the elastic one against it: masses of (x, y) where x moves both
    M = np.array([[4.0 + 7.0 + 2.0, 2.0], [2.0, 2.0]])
    expected = np.sqrt(120.0 * (np.linalg.inv(M)[1, 1] + 1.0 / 3.0))
    np.testing.assert_allclose(joint_resonances(chain, np.zeros(2)), [expected])
