"""The hand as a system: what it sees, and when."""

import numpy as np
from pydrake.systems.analysis import Simulator

from pfsc_drake.physics.live_hand import LiveHandModel, LiveHandParameters
from pfsc_drake.systems.physics.live_hand import LiveHand

PERIOD = 1e-3
POSE = np.concatenate([[0.8, 0.1, 0.9], np.eye(3).ravel()])
ASKED = np.array([5.0, 0.0, 0.0, 1.0, 0.9, 0.1, 0.8])


def test_over_time_it_is_the_model():
    system, model = (
        LiveHand(LiveHandParameters(), PERIOD),
        LiveHandModel(LiveHandParameters(), PERIOD),
    )
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.GetInputPort("asked").FixValue(context, ASKED)
    memory, last, pose = model.rest, POSE, POSE
    for tick in range(200):
        system.GetInputPort("tool_pose").FixValue(context, pose)
        simulator.AdvanceTo((tick + 1) * PERIOD)
        memory, wrench = model.advance(memory, ASKED, last, pose)
        assert np.array_equal(system.GetOutputPort("wrench").Eval(context), wrench)
        last, pose = pose, pose + 1e-5 * np.eye(12)[0]
    assert wrench[0] > 10.0


def test_it_does_nothing_to_a_tool_that_is_nowhere_and_goes_on_after():
    system = LiveHand(LiveHandParameters(), PERIOD)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.GetInputPort("asked").FixValue(context, ASKED)
    forces = []
    for tick, pose in enumerate([POSE] * 50 + [POSE * np.nan] + [POSE] * 2):
        system.GetInputPort("tool_pose").FixValue(context, pose)
        simulator.AdvanceTo((tick + 1) * PERIOD)
        forces.append(np.linalg.norm(system.GetOutputPort("wrench").Eval(context)))
    assert forces[49] > 1.0
    assert forces[50] == 0.0
    assert forces[52] > forces[49]
