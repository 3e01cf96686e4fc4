"""The observer as a system: in a loop with what drives the joints, and its memory."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Adder, ConstantVectorSource, Gain, ZeroOrderHold

from pfsc_drake.control.estimation.momentum import MomentumObserver, drive_momentum
from pfsc_drake.systems.block_system import BlockSystem

PERIOD, RATE, FRICTION = 1e-3, 200.0, np.array([20.0, -35.0, 9.0])
Q = np.array([0.3, 1.2, -0.5])
AT_REST = np.concatenate([Q, np.zeros(3), Q, np.zeros(3)])


@pytest.fixture(name="system")
def fixture_system(arm):
    observer = MomentumObserver(drive_momentum(arm.chain), RATE, PERIOD)
    return BlockSystem(observer, PERIOD)


def test_drives_may_depend_on_the_estimate(arm, system):
    """An arm that friction of its own weight's size holds at rest; no loop is algebraic."""
    builder = DiagramBuilder()
    builder.AddSystem(system)
    state = builder.AddSystem(ConstantVectorSource(AT_REST))
    weight = builder.AddSystem(ConstantVectorSource(arm.weight(Q) + FRICTION))
    minus, total = builder.AddSystem(Gain(-1.0, 3)), builder.AddSystem(Adder(2, 3))
    hold = builder.AddSystem(ZeroOrderHold(PERIOD, 3))
    builder.Connect(state.get_output_port(), system.GetInputPort("joint_state"))
    builder.Connect(system.GetOutputPort("estimate"), minus.get_input_port())
    builder.Connect(weight.get_output_port(), total.get_input_port(0))
    builder.Connect(minus.get_output_port(), total.get_input_port(1))
    builder.Connect(total.get_output_port(), system.GetInputPort("drive_torque"))
    builder.Connect(total.get_output_port(), hold.get_input_port())
    diagram = builder.Build()
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.4)
    context = system.GetMyContextFromRoot(simulator.get_context())
    # a drive that gives way to what it is told halves it
    np.testing.assert_allclose(
        system.GetOutputPort("estimate").Eval(context), FRICTION / 2.0, rtol=0, atol=1e-9
    )


def test_forces_that_are_known_are_no_friction(arm, system):
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    push = np.array([5.0, 12.0, -3.0])
    system.GetInputPort("joint_state").FixValue(context, AT_REST)
    system.GetInputPort("drive_torque").FixValue(context, arm.weight(Q) + FRICTION - push)
    system.GetInputPort("known_torque").FixValue(context, push)
    estimates = []
    for k in range(1, 40):
        simulator.AdvanceTo(k * PERIOD)
        estimates.append(system.GetOutputPort("estimate").Eval(context).copy())
    risen = 1.0 - np.exp(-RATE * PERIOD * np.arange(1, 40))
    np.testing.assert_allclose(estimates, np.outer(risen, FRICTION), rtol=0, atol=1e-9)


def test_a_new_start_forgets(arm, system):
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.GetInputPort("joint_state").FixValue(context, AT_REST)
    system.GetInputPort("drive_torque").FixValue(context, arm.weight(Q) + FRICTION)
    simulator.AdvanceTo(0.02)
    assert np.abs(system.GetOutputPort("estimate").Eval(context)).min() > 1.0
    context.SetTime(0.0)
    simulator.Initialize()
    assert not system.GetOutputPort("estimate").Eval(context).any()
