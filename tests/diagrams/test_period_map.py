"""The derivative of a sampled diagram's map against its closed form."""

import casadi as ca
import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LinearSystem, ZeroOrderHold
from scipy.linalg import expm

from diagrams.one_period_map import OnePeriodMap
from diagrams.period_map import PeriodDerivative
from experiments.simulation import configure
from pfsc_drake.blocks.block import Block, Port
from pfsc_drake.blocks.cases import where
from pfsc_drake.blocks.wiring_blocks import Hold
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.fuse import fuse_blocks

T = 0.01
F, B = np.array([[0.0, 1.0], [-40.0, -0.5]]), np.array([[0.0], [2.0]])
GAIN = np.array([[30.0, 4.0]])


class Controller(LeafSystem):
    """``u = -k (x + 0.1 last)`` with memory of the last x, a counter, a flag and a square."""

    def __init__(self):
        super().__init__()
        self.DeclareVectorInputPort("x", 2)
        memory = self.DeclareDiscreteState(np.array([0.0, 0.0, 0.0, 0.0]))
        self.DeclareVectorOutputPort(
            "u",
            1,
            self._calc,
            prerequisites_of_calc={
                self.input_port_ticket(self.get_input_port(0).get_index()),
                self.discrete_state_ticket(memory),
            },
        )
        self.DeclarePeriodicDiscreteUpdateEvent(T, 0.0, self._update)

    def _calc(self, context, output):
        memory = context.get_discrete_state_vector().value()
        x = self.get_input_port(0).Eval(context)
        stopped = memory[3] != 0.0
        output.SetFromVector([0.0] if stopped else -GAIN @ (x + 0.1 * memory[:2]))

    def _update(self, context, state):
        memory = state.get_mutable_value()
        memory[:2] = self.get_input_port(0).Eval(context)
        memory[2] += 1.0


class ControllerBlock(Block):
    """The same as a block, whose last x is known by name."""

    def __init__(self, share=1.0):
        self._gain = share * ca.DM(GAIN)
        self.inputs, self.outputs = {"motion": Port(2)}, {"command": Port(1)}
        self.states = {"last": 2, "count": 1, "stopped": 1}

    def output(self, x, u, t):
        command = -self._gain @ (u.motion + 0.1 * x.last)
        return {"command": where(x.stopped, 0.0, command)}

    def update(self, x, u, y, t):
        return {"last": u.motion, "count": x.count + 1.0}


class FirstHalf(Block):
    """``s+ = y``, ``y = s + 0.5 u``, twice in a period."""

    inputs, outputs, states = {"u": Port(1)}, {"y": Port(1)}, {"s": 1}

    def output(self, x, u, t):
        return {"y": x.s + 0.5 * u.u}

    def update(self, x, u, y, t):
        return {"s": 0.3 * y.y}


def make_loop(controller, hold, *between, fused=False):
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", LinearSystem(F, B, np.eye(2), np.zeros((2, 1))))
    output = plant.get_output_port()
    for name, system in (("controller", controller), *between, ("hold", hold)):
        builder.AddNamedSystem(name, system)
        builder.Connect(output, system.get_input_port(0))
        output = system.get_output_port(0)
    builder.Connect(output, plant.get_input_port())
    if fused:
        fuse_blocks(builder)
    diagram = builder.Build()
    one_period = OnePeriodMap(diagram, T, integrate)
    return diagram, one_period, plant, hold, PeriodDerivative(one_period, diagram, integrate)


@pytest.fixture(name="loop")
def fixture_loop():
    return make_loop(Controller(), ZeroOrderHold(T, 1))


def integrate(simulator):
    configure(simulator, "runge_kutta5", T / 10)


def after_ticks(diagram, ticks):
    simulator = Simulator(diagram)
    integrate(simulator)
    context = simulator.get_mutable_context()
    context.SetContinuousState([0.3, -0.2])
    simulator.Initialize()
    simulator.AdvanceTo(ticks * T)
    simulator.AdvancePendingEvents()
    return context


def test_unperturbed_it_is_the_run_itself(loop):
    diagram, one_period = loop[:2]
    for ticks in (1, 29, 1200):  # 1200 * 0.01 is not 1199 * 0.01 + 0.01 in floating point
        arrived = one_period.advance(after_ticks(diagram, ticks))
        np.testing.assert_allclose(
            arrived, one_period.variables(after_ticks(diagram, ticks + 1)), rtol=1e-6, atol=1e-9
        )


def test_it_knows_whose_variables_are_whose(loop):
    _, one_period, plant, hold, _ = loop
    np.testing.assert_array_equal(one_period.rows(plant), [0, 1])
    assert len(one_period.rows(hold)) == 1
    assert one_period.size == 2 + 4 + 1


LOOPS = [
    lambda: make_loop(Controller(), ZeroOrderHold(T, 1)),
    lambda: make_loop(Controller(), BlockSystem(Hold(1), T)),
    lambda: make_loop(BlockSystem(ControllerBlock(), T), ZeroOrderHold(T, 1)),
    lambda: make_loop(BlockSystem(ControllerBlock(), T), BlockSystem(Hold(1), T)),
]


@pytest.mark.parametrize("make", LOOPS)
def test_the_derivative_is_that_of_the_sampled_loop(make):
    diagram, one_period, _, hold, derivative = make()
    section = after_ticks(diagram, 7)
    before = one_period.variables(section)
    A = derivative.at(section).A
    exponential = expm(np.block([[F, B], [np.zeros((1, 3))]]) * T)
    motion, hold_row = exponential[:2], int(one_period.rows(hold)[-1])
    controller = one_period.rows(diagram.GetSubsystemByName("controller"))[-4:]
    memory, plant, command = controller[:2], [0, 1], -GAIN @ motion
    columns = [0, 1, hold_row]
    np.testing.assert_allclose(A[np.ix_(plant, columns)], motion, rtol=1e-6, atol=1e-7)
    # right after the tick the controller remembers x, and the hold has what it made of both
    np.testing.assert_allclose(A[np.ix_(memory, columns)], motion, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(A[hold_row, columns], command[0], rtol=1e-6)
    np.testing.assert_allclose(A[hold_row, memory], -0.1 * GAIN[0], rtol=1e-6)
    np.testing.assert_array_equal(A[plant][:, memory], 0.0)
    # what stops the controller when it is not zero has no slope
    np.testing.assert_array_equal(A[:, controller[3]] * (np.arange(len(A)) != controller[3]), 0.0)
    np.testing.assert_array_equal(one_period.variables(section), before)


def test_a_block_that_samples_twice_in_a_period():
    """Against the linear map of two halves, written out."""
    between = ("half", BlockSystem(FirstHalf(), T / 2))
    loop = make_loop(BlockSystem(ControllerBlock(), T), BlockSystem(Hold(1), T / 2), between)
    diagram, one_period, _, hold, derivative = loop
    half = diagram.GetSubsystemByName("half")
    last = one_period.rows(diagram.GetSubsystemByName("controller"))[-4:-2]
    rows = [0, 1, *last, one_period.rows(half)[-1], one_period.rows(hold)[-1]]
    found = derivative.at(after_ticks(diagram, 7)).A[np.ix_(rows, rows)]
    exponential = expm(np.block([[F, B], [np.zeros((1, 3))]]) * (T / 2))
    flow = np.eye(6)
    flow[np.ix_([0, 1], [0, 1, 5])] = exponential[:2]
    # y = s - k (x + 0.1 last) / 2, held; s+ = 0.3 y; last+ = x at whole ticks
    y = np.concatenate([-0.5 * GAIN[0], -0.05 * GAIN[0], [1.0, 0.0]])
    jump = np.eye(6)
    jump[4], jump[5] = 0.3 * y, y
    whole = jump.copy()
    whole[2:4] = np.eye(6)[:2]
    np.testing.assert_allclose(found, whole @ flow @ jump @ flow, rtol=1e-6, atol=1e-7)


def test_a_choice_of_variables_is_a_part_of_the_whole():
    diagram, _, _, _, derivative = LOOPS[3]()
    section, chosen = after_ticks(diagram, 3), np.array([0, 1, 10])
    whole = derivative.at(section)
    part = derivative.at(section, chosen, whole.rest)
    np.testing.assert_array_equal(part.A, whole.A[np.ix_(chosen, chosen)])


@pytest.mark.parametrize("fused", [False, True])
def test_what_is_no_block_is_the_same_for_other_blocks(fused):
    def loop_of(share):
        controller = BlockSystem(ControllerBlock(share), T)
        return make_loop(controller, BlockSystem(Hold(1), T), fused=fused)

    diagram, _, _, _, derivative = loop_of(1.0)
    _, other_period, _, _, other = loop_of(0.7)
    known = {ticks: derivative.at(after_ticks(diagram, ticks)).rest for ticks in (3, 8)}
    for ticks, rest in known.items():
        section = other_period.adopted(after_ticks(diagram, ticks))
        own, reused = other.at(section), other.at(section, None, rest)
        # steps of differences are relative to what is put out
        np.testing.assert_allclose(reused.A, own.A, rtol=1e-9, atol=1e-9)
        for name, value in own.wires.items():
            np.testing.assert_allclose(reused.wires[name], value, rtol=1e-12)


def test_it_tells_what_blocks_put_out():
    diagram, one_period, _, hold, derivative = LOOPS[3]()
    section = after_ticks(diagram, 3)
    command = derivative.wires(section)["controller.command"]
    one_period.approach(section)
    one_period.pass_tick()
    own = hold.GetMyContextFromRoot(one_period.context)
    np.testing.assert_allclose(hold.state(own, "held"), command, rtol=1e-14)
    assert one_period.rows(hold)[-1] == derivative.states["hold.held"][0]
