"""Where the tool is and how it moves, against Drake."""

import numpy as np

from pfsc_drake.systems.physics.tool_motion import ToolMotion


def test_motion_is_drakes(arm):
    system = ToolMotion(arm.chain)
    context = system.CreateDefaultContext()
    random = np.random.default_rng(1)
    for _ in range(10):
        state = random.uniform(-1.5, 1.5, 12)
        system.get_input_port().FixValue(context, state)
        motion = system.get_output_port().Eval(context)
        np.testing.assert_allclose(motion[:12], arm.pose(state[:3]), atol=1e-12)
        arm.plant.SetVelocities(arm.context, state[3:6])
        V_WT = arm.tool.CalcSpatialVelocityInWorld(arm.context)
        expected = [*V_WT.translational(), *V_WT.rotational()]
        np.testing.assert_allclose(motion[12:], expected, atol=1e-12)
