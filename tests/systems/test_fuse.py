"""The blocks of a diagram as one system, and by name whether they are one system or many."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Integrator, LogVectorOutput, MatrixGain

from pfsc_drake.blocks.block import Block, Port
from pfsc_drake.blocks.wiring_blocks import Collect, Constant, Hold, Rows, Sum
from pfsc_drake.errors import InputError
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.fuse import BlockAccess, fuse, fuse_blocks

PERIOD = 0.01


class Servo(Block):
    """PI control: ``a = -k e - i``, ``i+ = i + T j e``, ``e = q - r (+ bias)``."""

    def __init__(self, k=3.0, j=2.0):
        self.k, self.j = k, j
        self.inputs = {"q": Port(1), "r": Port(1), "bias": Port(1, optional=True)}
        self.outputs = {"a": Port(1), "error": Port(1)}
        self.states = {"integral": 1}

    def initial(self, u, t):
        return {"integral": -u.r}

    def output(self, x, u, t):
        error = u.q - u.r + (0.0 if u.bias is None else u.bias)
        return {"a": -self.k * error - x.integral, "error": error}

    def update(self, x, u, y, t):
        return {"integral": x.integral + PERIOD * self.j * y.error}


class Ramp(Block):
    """``r = T t``."""

    def __init__(self):
        self.inputs, self.outputs, self.states = {}, {"r": Port(1)}, {}

    def output(self, x, u, t):
        return {"r": PERIOD * t}


def add_servo(builder, q):
    """Add ramp, servo and hold, and return the held value and the logged one."""
    ramp = builder.AddNamedSystem("ramp", BlockSystem(Ramp(), PERIOD))
    servo = builder.AddNamedSystem("servo", BlockSystem(Servo(), PERIOD))
    hold = builder.AddNamedSystem("hold", BlockSystem(Hold(1), PERIOD))
    collect = builder.AddNamedSystem("collect", BlockSystem(Collect({"q": 1, "a": 1}), PERIOD))
    if q is not None:
        builder.Connect(q, servo.GetInputPort("q"))
        builder.Connect(q, collect.GetInputPort("q"))
    builder.Connect(ramp.GetOutputPort("r"), servo.GetInputPort("r"))
    builder.Connect(servo.GetOutputPort("a"), hold.GetInputPort("value"))
    builder.Connect(servo.GetOutputPort("a"), collect.GetInputPort("a"))
    return servo, hold, collect


def closed_loop(fused):
    """Return the logs of a double integrator that follows a ramp."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", Integrator(2))
    position = builder.AddNamedSystem("position", MatrixGain(np.array([[1.0, 0.5]])))
    shift = builder.AddNamedSystem("shift", MatrixGain(np.array([[0.0], [1.0]])))
    builder.Connect(plant.get_output_port(), position.get_input_port())
    builder.Connect(shift.get_output_port(), plant.get_input_port())
    _, hold, collect = add_servo(builder, position.get_output_port())
    builder.Connect(hold.GetOutputPort("held"), shift.get_input_port())
    log = LogVectorOutput(collect.GetOutputPort("all"), builder, PERIOD)
    if fused:
        assert len(fuse_blocks(builder)) == 1
        assert not builder.HasSubsystemNamed("servo")
    diagram = builder.Build()
    simulator = Simulator(diagram)
    access, root = BlockAccess(diagram), simulator.get_mutable_context()
    access.set_state(root, "hold.held", np.array([0.25]))
    simulator.AdvanceTo(0.5)
    ends = [access.state(root, "servo.integral"), access.output(root, "servo.error")]
    return log.FindLog(root).data().copy(), np.concatenate(ends)


def test_a_fused_loop_logs_the_same_to_the_last_bit():
    one_by_one, fused = closed_loop(False), closed_loop(True)
    assert one_by_one[0].shape == (2, 51)
    assert one_by_one[0][0, -1] > 0.1
    for expected, found in zip(one_by_one, fused, strict=True):
        np.testing.assert_array_equal(found, expected)


def follower():
    builder = DiagramBuilder()
    servo, hold, _ = add_servo(builder, None)
    index = builder.ExportInput(servo.GetInputPort("q"), "position")
    collect = builder.GetSubsystemByName("collect")
    builder.ConnectInput(index, collect.GetInputPort("q"))
    builder.ExportInput(servo.GetInputPort("bias"), "bias")
    builder.ExportOutput(hold.GetOutputPort("held"), "force")
    builder.ExportOutput(servo.GetOutputPort("error"), "error")
    diagram = builder.Build()
    diagram.set_name("follower")
    return diagram


def test_a_diagram_of_blocks_is_one_system_with_its_ports():
    diagram = follower()
    systems = {"one by one": diagram, "fused": fuse(follower())}
    ends = {}
    for name, system in systems.items():
        simulator = Simulator(system)
        root = simulator.get_mutable_context()
        system.GetInputPort("position").FixValue(root, 0.3)
        system.GetInputPort("bias").FixValue(root, 0.125)
        simulator.AdvanceTo(0.205)
        ends[name] = [system.GetOutputPort(port).Eval(root)[0] for port in ("force", "error")]
    assert ends["fused"] == ends["one by one"]
    assert ends["fused"][1] == 0.3 - 0.2 + 0.125


def test_a_diagram_of_blocks_within_a_diagram_is_fused_with_the_others():
    """Its optional port, not connected, is none."""
    builder = DiagramBuilder()
    inner = builder.AddSystem(follower())
    value = builder.AddNamedSystem("value", BlockSystem(Constant([0.3]), PERIOD))
    double = builder.AddNamedSystem("double", BlockSystem(Sum(2, 1), PERIOD))
    builder.Connect(value.GetOutputPort("value"), inner.GetInputPort("position"))
    for k in range(2):
        builder.Connect(inner.GetOutputPort("error"), double.GetInputPort(f"term_{k}"))
    log = LogVectorOutput(double.GetOutputPort("sum"), builder, PERIOD)
    (fused,) = fuse_blocks(builder)
    assert fused.num_input_ports() == 0
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.1)
    expected = 2.0 * (0.3 - PERIOD * np.arange(11))
    np.testing.assert_array_equal(log.FindLog(simulator.get_context()).data()[0], expected)


def test_rows_are_the_requested_ones():
    system = BlockSystem(Rows(4, [3, 1]), PERIOD)
    context = system.CreateDefaultContext()
    system.get_input_port().FixValue(context, [5.0, 6.0, 7.0, 8.0])
    np.testing.assert_array_equal(system.get_output_port().Eval(context), [8.0, 6.0])


def test_what_is_no_block_is_not_fused():
    builder = DiagramBuilder()
    builder.AddSystem(BlockSystem(Ramp(), PERIOD))
    builder.AddSystem(Integrator(1))
    diagram = builder.Build()
    diagram.set_name("mixed")
    assert isinstance(diagram, Diagram)
    with pytest.raises(InputError, match="diagram mixed: must consist of blocks"):
        fuse(diagram)
