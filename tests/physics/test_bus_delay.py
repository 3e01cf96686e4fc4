"""Samples arrive late by exactly the bus's delay, and none is made up."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, EventStatus, LeafSystem
from pydrake.systems.primitives import ZeroOrderHold

from pfsc_drake.blocks.network import Network
from pfsc_drake.blocks.network_program import Program
from pfsc_drake.errors import InputError
from pfsc_drake.physics.velocity_servo import BusDelay
from pfsc_drake.systems.block_system import BlockSystem

T = 1e-3
PORTS = {BlockSystem: "delivered", ZeroOrderHold: "y"}


class Clock(LeafSystem):
    """Sends ``[7 + t, -t]``."""

    def __init__(self):
        super().__init__()
        self.DeclareVectorOutputPort("out", 2, self._calc)

    def _calc(self, context, output):
        output.SetFromVector([7.0 + context.get_time(), -context.get_time()])


class LateStarter(LeafSystem):
    """Sends 0 until it is initialized, then 5, as a controller whose memory is filled then."""

    def __init__(self):
        super().__init__()
        self.DeclareStateOutputPort("out", self.DeclareDiscreteState(1))
        self.DeclareInitializationDiscreteUpdateEvent(self._start)

    def _start(self, context, state):
        state.set_value([5.0])
        return EventStatus.Succeeded()


def add_bus_delay(builder, port, delay, period, lost=(0.0, 0.0)):
    bus = builder.AddSystem(BlockSystem(BusDelay(port.size(), delay, period, lost), period))
    builder.Connect(port, bus.GetInputPort("sent"))
    return bus


def build(delay, period=T):
    builder = DiagramBuilder()
    bus = add_bus_delay(builder, builder.AddSystem(Clock()).get_output_port(), delay, period)
    hold = builder.AddSystem(ZeroOrderHold(period, 2))
    builder.Connect(bus.GetOutputPort("delivered"), hold.get_input_port())
    simulator = Simulator(builder.Build())
    return simulator, bus, hold


@pytest.mark.parametrize("periods", [1, 2, 5])
def test_delay_for_readers_between_and_at_the_ticks(periods):
    simulator, bus, hold = build(periods * T)
    simulator.Initialize()
    root = simulator.get_context()
    for k in range(12):
        simulator.AdvanceTo(k * T + 0.4 * T)
        # between the ticks, and as sampled by a discrete update at the tick before
        for system in (bus, hold):
            got = system.GetOutputPort(PORTS[type(system)]).Eval(system.GetMyContextFromRoot(root))
            sent = max(k - periods, 0) * T
            assert np.allclose(got, [7.0 + sent, -sent], rtol=0, atol=1e-12)


def test_delivers_the_present_input_from_the_start():
    simulator, bus, _ = build(2e-3)
    simulator.get_mutable_context().SetTime(3.0)
    simulator.Initialize()
    got = bus.GetOutputPort("delivered").Eval(bus.GetMyContextFromRoot(simulator.get_context()))
    assert np.allclose(got, [10.0, -3.0], rtol=0, atol=1e-12)
    # a run may start between two ticks
    simulator.get_mutable_context().SetTime(3.0004)
    simulator.Initialize()
    simulator.AdvanceTo(3.0008)
    got = bus.GetOutputPort("delivered").Eval(bus.GetMyContextFromRoot(simulator.get_context()))
    assert np.allclose(got, [10.0004, -3.0004], rtol=0, atol=1e-12)


def test_what_a_sender_had_before_it_was_initialized_is_never_delivered():
    builder = DiagramBuilder()
    sender = builder.AddSystem(LateStarter())
    bus = add_bus_delay(builder, sender.get_output_port(), 3 * T, T)
    simulator = Simulator(builder.Build())
    simulator.Initialize()
    for k in range(6):
        simulator.AdvanceTo((k + 0.4) * T)
        context = bus.GetMyContextFromRoot(simulator.get_context())
        assert bus.GetOutputPort("delivered").Eval(context)[0] == 5.0


def test_no_direct_feedthrough():
    """Except at the start, when the output is the present input."""
    program = Program(Network.of(BusDelay(3, 2e-3, 1e-3)))
    for port in ("delivered", "silence"):
        stage, _ = program.output(port)
        assert not any(source.kind == "input" for source in program.stages[stage].needs)


def test_contexts_do_not_share_samples():
    bus = BlockSystem(BusDelay(1, 2e-3, 1e-3), 1e-3)
    simulators = [Simulator(bus) for _ in range(2)]
    for value, simulator in enumerate(simulators):
        context = simulator.get_mutable_context()
        bus.GetInputPort("sent").FixValue(context, [float(value)])
        simulator.Initialize()
    for value, simulator in enumerate(simulators):
        assert bus.GetOutputPort("delivered").Eval(simulator.get_context())[0] == value


@pytest.mark.parametrize(
    ("delay", "period"),
    [
        (1.5e-3, 1e-3),
        (0.0, 1e-3),
        (-2e-3, 1e-3),
        (np.nan, 1e-3),
        (np.inf, 1e-3),
        (1e-4, 1e-3),
        (1e300, 1e-3),
    ],
)
def test_delay_must_be_whole_periods(delay, period):
    with pytest.raises(InputError, match=r"a positive multiple of the period 0.001 s, up to 10 s"):
        BusDelay(1, delay, period)


def test_period_must_be_positive():
    with pytest.raises(InputError, match=r"period = 0.0 s; must be positive"):
        BusDelay(1, 2e-3, 0.0)


def test_lost_frames():
    """Frames from 3 ms to 6 ms never arrive; the output keeps its last value."""
    builder = DiagramBuilder()
    clock = builder.AddSystem(Clock())
    bus = add_bus_delay(builder, clock.get_output_port(), 2 * T, T, lost=(2.5 * T, 5.5 * T))
    simulator = Simulator(builder.Build())
    simulator.Initialize()
    delivered, silence = [], []
    for k in range(12):
        simulator.AdvanceTo(k * T + 0.4 * T)
        context = bus.GetMyContextFromRoot(simulator.get_context())
        delivered.append(-bus.GetOutputPort("delivered").Eval(context)[1] / T)
        silence.append(bus.GetOutputPort("silence").Eval(context)[0] / T)
    np.testing.assert_allclose(delivered, [0, 0, 0, 1, 2, 2, 2, 2, 6, 7, 8, 9], atol=1e-9)
    np.testing.assert_allclose(silence, [0, 0, 0, 0, 0, 1, 2, 3, 0, 0, 0, 0], atol=1e-9)
