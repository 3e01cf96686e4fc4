"""Where the tool is and how it moves, against Drake."""

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.physics.tool_motion import ToolMotion
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant


def test_motion_is_drakes():
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(resolve_model("comau_racer_1_4_3r")))
    plant.Finalize()
    tool, context = plant.GetFrameByName("tool_point"), plant.CreateDefaultContext()
    chain, _ = chain_from_plant(plant, tool)
    stepper, random = Stepper(ToolMotion(chain)), np.random.default_rng(1)
    for _ in range(10):
        state = random.uniform(-1.5, 1.5, 12)
        plant.SetPositions(context, state[:3])
        plant.SetVelocities(context, state[3:6])
        X_WT, V_WT = tool.CalcPoseInWorld(context), tool.CalcSpatialVelocityInWorld(context)
        pose = np.concatenate([X_WT.translation(), X_WT.rotation().matrix().ravel()])
        motion = stepper.step(joint_state=state)["tool_motion"]
        np.testing.assert_allclose(motion[:12], pose, atol=1e-12)
        expected = [*V_WT.translational(), *V_WT.rotational()]
        np.testing.assert_allclose(motion[12:], expected, atol=1e-12)
