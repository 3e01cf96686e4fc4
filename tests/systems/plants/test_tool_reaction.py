"""Load of a sensor, by Newton-Euler for the tool alone, against Drake's reactions."""

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant

from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.systems.plants.reactions import ToolReaction, reaction_index, tool_load_from_plant


@pytest.fixture(name="plant", scope="module")
def fixture_plant():
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4")))
    plant.Finalize()
    return plant


@pytest.mark.parametrize("pushed", [False, True])
def test_the_reaction_is_that_of_the_plant(plant, pushed):
    rng, tool = np.random.default_rng(5), plant.GetFrameByName("tool_point")
    joint = plant.GetJointByName("weld_tool")
    chain, coordinates = chain_from_plant(plant, tool)
    context = plant.CreateDefaultContext()
    x = rng.uniform(-1.0, 1.0, 12)
    plant.SetPositionsAndVelocities(context, x)
    plant.get_actuation_input_port().FixValue(context, 100.0 * rng.uniform(-1, 1, 6))
    wrench = 40.0 * rng.uniform(-1, 1, 6) if pushed else np.zeros(6)
    force = ExternallyAppliedSpatialForce()
    force.body_index = tool.body().index()
    X_BT = plant.CalcRelativeTransform(context, tool.body().body_frame(), tool)
    force.p_BoBq_B = X_BT.translation()
    force.F_Bq_W = SpatialForce(wrench[3:], wrench[:3])
    plant.get_applied_spatial_force_input_port().FixValue(context, [force])
    acceleration = plant.EvalTimeDerivatives(context).CopyToVector()[6:]
    reactions = plant.get_reaction_forces_output_port().Eval(context)
    expected = reactions[reaction_index(plant, joint)].get_coeffs()

    system = ToolReaction(chain, tool_load_from_plant(plant, joint, tool))
    own = system.CreateDefaultContext()
    motion = coordinates.link_rows @ x
    system.GetInputPort("joint_state").FixValue(own, np.concatenate([motion, motion]))
    system.GetInputPort("acceleration").FixValue(own, acceleration)
    if pushed:
        system.GetInputPort("wrench").FixValue(own, wrench)
    reaction = system.GetOutputPort("reaction").Eval(own)
    assert np.abs(expected).max() > 10.0
    np.testing.assert_allclose(reaction, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    assert RigidTransform(X_BT).translation().any()


def test_contexts_do_not_share_what_pushes(plant):
    """A port that is not connected is no push, whatever acted in another context."""
    tool, joint = plant.GetFrameByName("tool_point"), plant.GetJointByName("weld_tool")
    chain, _ = chain_from_plant(plant, tool)
    system = ToolReaction(chain, tool_load_from_plant(plant, joint, tool))
    reactions = []
    for wrench in (None, np.full(6, 30.0), None):
        context = system.CreateDefaultContext()
        system.GetInputPort("joint_state").FixValue(context, np.full(24, 0.3))
        system.GetInputPort("acceleration").FixValue(context, np.zeros(6))
        if wrench is not None:
            system.GetInputPort("wrench").FixValue(context, wrench)
        reactions.append(system.GetOutputPort("reaction").Eval(context))
    assert np.abs(reactions[1] - reactions[0]).max() > 10.0
    np.testing.assert_array_equal(reactions[2], reactions[0])
