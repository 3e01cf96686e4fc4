"""Direct kinematics as a system, against Drake."""

import numpy as np

from pfsc_drake.control.manifolds.manifold import ToolKinematics
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.links import ChainLink
from pfsc_drake.systems.block_system import BlockSystem


def test_tool_pose_is_drakes(arm):
    system = BlockSystem(ToolKinematics(arm.chain), 1e-3)
    context = system.CreateDefaultContext()
    rng = np.random.default_rng(1)
    for _ in range(10):
        state = rng.uniform(-1.5, 1.5, 12)
        system.get_input_port().FixValue(context, state)
        assert np.allclose(
            system.get_output_port().Eval(context), arm.pose(state[:3]), rtol=0, atol=1e-12
        )


def test_ports_and_state():
    """Names in the field's words, no memory, and a slide that lifts the tool."""
    link = ChainLink(
        "slide",
        "prismatic",
        np.eye(3),
        np.zeros(3),
        np.array([0.0, 0.0, 1.0]),
        1.0,
        np.zeros(3),
        np.eye(3),
    )
    system = BlockSystem(ToolKinematics(SerialChain((link,))), 1e-3)
    assert system.GetInputPort("joint_state").size() == 4
    assert system.GetOutputPort("tool_pose").size() == 12
    context = system.CreateDefaultContext()
    assert not system.states
    system.get_input_port().FixValue(context, [0.7, 0.0, 0.0, 0.0])
    expected = [0.0, 0.0, 0.7, *np.eye(3).ravel()]
    assert np.allclose(system.get_output_port().Eval(context), expected, rtol=0, atol=1e-15)


def test_two_contexts_of_one_system_do_not_share_results(arm):
    system = BlockSystem(ToolKinematics(arm.chain), 1e-3)
    contexts = [system.CreateDefaultContext() for _ in range(2)]
    states = np.random.default_rng(2).uniform(-1.0, 1.0, (2, 12))
    for context, state in zip(contexts, states, strict=True):
        system.get_input_port().FixValue(context, state)
    poses = [system.get_output_port().Eval(context) for context in contexts]
    for pose, state in zip(poses, states, strict=True):
        assert np.allclose(pose, arm.pose(state[:3]), rtol=0, atol=1e-12)
