"""Blocks in Drake diagrams: ticks, starts, feedthrough, inputs that are not connected."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Gain, LogVectorOutput

from pfsc_drake.blocks.block import Block, Port
from pfsc_drake.blocks.network import Network, Wiring
from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.systems.block_system import BlockSystem

PERIOD = 1e-3


class Lag(Block):
    """``y = x``, ``x+ = x + (u - x) / 4 + b``, from the first input on; and the ticks."""

    def __init__(self):
        self.inputs = {"value": Port(1), "bias": Port(1, optional=True)}
        self.outputs = {"lagged": Port(1), "rate": Port(1), "tick": Port(1)}
        self.states = {"value": 1, "other": 2}

    def initial(self, u, t):
        return {"value": u.value}

    def output(self, x, u, t):
        return {"lagged": x.value, "rate": (u.value - x.value) / 4.0, "tick": t}

    def update(self, x, u, y, t):
        return {"value": x.value + y.rate + (0.0 if u.bias is None else u.bias)}


def test_a_simulation_steps_as_by_hand():
    system = BlockSystem(Lag(), PERIOD)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.GetInputPort("value").FixValue(context, 2.0)
    simulator.Initialize()
    system.GetInputPort("value").FixValue(context, 6.0)
    stepper = Stepper(Lag())
    stepper.start(value=2.0)
    for k in range(1, 20):
        expected = stepper.step(value=6.0)
        simulator.AdvanceTo(k * PERIOD - PERIOD / 2.0)
        assert system.GetOutputPort("tick").Eval(context)[0] == k - 1
        assert expected["tick"][0] == k - 1
        assert system.state(context, "value")[0] == stepper.states["value"][0]
    assert system.state(context, "value")[0] > 5.9


@pytest.mark.parametrize("bias", [None, 0.5])
def test_inputs_that_are_not_connected(bias):
    system = BlockSystem(Lag(), PERIOD)
    context = system.CreateDefaultContext()
    system.GetInputPort("value").FixValue(context, 1.0)
    if bias is not None:
        system.GetInputPort("bias").FixValue(context, bias)
    simulator = Simulator(system, context)
    simulator.AdvanceTo(PERIOD / 2.0)
    assert system.GetOutputPort("lagged").Eval(context)[0] == 1.0 + (bias or 0.0)


def test_feedthrough_is_that_of_the_expressions():
    system = BlockSystem(Lag(), PERIOD)
    ports = {name: system.GetOutputPort(name).get_index() for name in ("rate", "tick")}
    value, bias = (system.GetInputPort(name).get_index() for name in ("value", "bias"))
    assert system.HasDirectFeedthrough(value, ports["rate"])
    assert not system.HasDirectFeedthrough(bias, ports["rate"])
    assert not system.HasDirectFeedthrough(value, ports["tick"])


def test_starts_follow_the_wires_whatever_the_order():
    """Three lags in a row start from the source, also the last one, which was added first."""
    builder = DiagramBuilder()
    lags = [builder.AddNamedSystem(f"lag_{k}", BlockSystem(Lag(), PERIOD)) for k in range(3)]
    source = builder.AddSystem(ConstantVectorSource([7.0]))
    builder.Connect(source.get_output_port(), lags[2].GetInputPort("value"))
    builder.Connect(lags[2].GetOutputPort("lagged"), lags[1].GetInputPort("value"))
    builder.Connect(lags[1].GetOutputPort("lagged"), lags[0].GetInputPort("value"))
    log = LogVectorOutput(lags[0].GetOutputPort("lagged"), builder, PERIOD)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(3 * PERIOD)
    np.testing.assert_array_equal(log.FindLog(simulator.get_context()).data(), 7.0)


def test_a_state_that_was_set_survives_the_start_but_not_the_next():
    system = BlockSystem(Lag(), PERIOD)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.GetInputPort("value").FixValue(context, 2.0)
    system.set_state(context, "value", np.array([9.0]))
    assert system.GetOutputPort("lagged").Eval(context)[0] == 9.0
    simulator.Initialize()
    assert system.state(context, "value")[0] == 9.0
    simulator.AdvanceTo(0.01)
    context.SetTime(0.0)
    simulator.Initialize()
    assert system.state(context, "value")[0] == 2.0


class Sum(Block):
    """``y = x + u``, ``x`` being the first input."""

    def __init__(self):
        self.inputs, self.outputs, self.states = {"u": Port(1)}, {"y": Port(1)}, {"x": 1}

    def initial(self, u, t):
        return {"x": u.u}

    def output(self, x, u, t):
        return {"y": x.x + u.u}


def test_a_start_may_follow_from_what_the_system_itself_puts_out():
    """By way of another system, as where blocks are one system and another is none."""
    builder = DiagramBuilder()
    wiring = Wiring(
        {name: Network.of(Sum()) for name in ("one", "two")},
        {("one", "u"): "a", ("two", "u"): "b"},
        {"x": ("one", "y"), "y": ("two", "y")},
    )
    sums = builder.AddSystem(BlockSystem(wiring.network(), PERIOD))
    source, gain = builder.AddSystem(ConstantVectorSource([7.0])), builder.AddSystem(Gain(2.0, 1))
    builder.Connect(source.get_output_port(), sums.GetInputPort("a"))
    builder.Connect(sums.GetOutputPort("x"), gain.get_input_port())
    builder.Connect(gain.get_output_port(), sums.GetInputPort("b"))
    simulator = Simulator(builder.Build())
    simulator.Initialize()
    context = sums.GetMyContextFromRoot(simulator.get_context())
    assert (sums.state(context, "one.x")[0], sums.state(context, "two.x")[0]) == (7.0, 28.0)


def test_a_context_can_be_started_without_a_simulation():
    system = BlockSystem(Lag(), PERIOD)
    context = system.CreateDefaultContext()
    system.GetInputPort("value").FixValue(context, 2.0)
    system.start(context)
    system.GetInputPort("value").FixValue(context, 5.0)
    assert system.GetOutputPort("lagged").Eval(context)[0] == 2.0


class Shown(Block):
    """Puts out states as they are: one that is zero at the start, and one that is not; counts."""

    def __init__(self):
        self.inputs = {"u": Port(2)}
        self.outputs = {name: Port(2) for name in ("held", "begun", "twice")}
        self.states = {"count": 1, "held": 2, "begun": 2}

    def initial(self, u, t):
        return {"begun": u.u}

    def output(self, x, u, t):
        return {"held": x.held, "begun": x.begun, "twice": 2.0 * x.held}

    def update(self, x, u, y, t):
        return {"held": x.held + u.u, "count": x.count + 1.0}


def test_a_state_that_is_put_out_as_it_is():
    """Its port is the state itself, before the start, when it is set, and after the ticks."""
    system = BlockSystem(Shown(), PERIOD)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.GetInputPort("u").FixValue(context, [1.0, 2.0])
    delayed, twice = (system.GetOutputPort(name) for name in ("held", "twice"))
    assert context.num_discrete_state_groups() == 2
    assert context.get_discrete_state(1).size() == 2
    np.testing.assert_array_equal(delayed.Eval(context), [0.0, 0.0])
    system.set_state(context, "held", np.array([5.0, 6.0]))
    np.testing.assert_array_equal(delayed.Eval(context), [5.0, 6.0])
    np.testing.assert_array_equal(twice.Eval(context), [10.0, 12.0])
    assert system.is_set(context, "held") and not system.is_set(context, "begun")
    np.testing.assert_array_equal(system.GetOutputPort("begun").Eval(context), [1.0, 2.0])
    for k in range(1, 4):
        simulator.AdvanceTo((k - 0.5) * PERIOD)
        expected = np.array([5.0, 6.0]) + k * np.array([1.0, 2.0])
        np.testing.assert_array_equal(delayed.Eval(context), expected)
        np.testing.assert_array_equal(twice.Eval(context), 2.0 * expected)
        np.testing.assert_array_equal(system.wire(context, "held"), expected)
        np.testing.assert_array_equal(system.state(context, "held"), expected)
        assert system.state(context, "count")[0] == k
        np.testing.assert_array_equal(system.state(context, "begun"), [1.0, 2.0])
    variables = np.concatenate([context.get_discrete_state(k).value() for k in range(2)])
    for name, part in system.states.items():
        np.testing.assert_array_equal(variables[part], system.state(context, name))
