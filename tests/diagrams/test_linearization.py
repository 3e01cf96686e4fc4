"""The derivative of a sampled diagram's map against its closed form."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LinearSystem, ZeroOrderHold
from scipy.linalg import expm

from diagrams.linearization import OnePeriodMap
from experiments.simulation import configure

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


@pytest.fixture(name="loop")
def fixture_loop():
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", LinearSystem(F, B, np.eye(2), np.zeros((2, 1))))
    controller = builder.AddNamedSystem("controller", Controller())
    hold = builder.AddNamedSystem("hold", ZeroOrderHold(T, 1))
    builder.Connect(plant.get_output_port(), controller.get_input_port())
    builder.Connect(controller.get_output_port(), hold.get_input_port())
    builder.Connect(hold.get_output_port(), plant.get_input_port())
    diagram = builder.Build()
    return diagram, OnePeriodMap(diagram, T, integrate), plant, hold


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
    diagram, one_period, *_ = loop
    for ticks in (1, 29, 1200):  # 1200 * 0.01 is not 1199 * 0.01 + 0.01 in floating point
        arrived = one_period.advance(after_ticks(diagram, ticks))
        np.testing.assert_allclose(
            arrived, one_period.variables(after_ticks(diagram, ticks + 1)), rtol=1e-6, atol=1e-9
        )


def test_it_knows_whose_variables_are_whose(loop):
    _, one_period, plant, hold = loop
    np.testing.assert_array_equal(one_period.rows(plant), [0, 1])
    assert len(one_period.rows(hold)) == 1
    assert one_period.size == 2 + 4 + 1


def test_the_derivative_is_that_of_the_sampled_loop(loop):
    diagram, one_period, _, hold = loop
    section = after_ticks(diagram, 7)
    before = one_period.variables(section)
    slope = one_period.derivative(section)
    exponential = expm(np.block([[F, B], [np.zeros((1, 3))]]) * T)
    motion, hold_row = exponential[:2], int(one_period.rows(hold)[0])
    memory = [i for i in range(2, 7) if i != hold_row]
    expected = np.zeros((7, 7))
    expected[np.ix_([0, 1], [0, 1, hold_row])] = motion
    # right after the tick the controller remembers x, and the hold has what it made of both
    expected[np.ix_(memory[:2], [0, 1, hold_row])] = motion
    told = -GAIN @ motion
    expected[hold_row, [0, 1, hold_row]] = told[0]
    expected[hold_row, memory[:2]] = -0.1 * GAIN[0]
    expected[memory[2], memory[2]] = 1.0
    smooth = ~slope.switches
    np.testing.assert_allclose(
        slope.A[np.ix_(smooth, smooth)], expected[np.ix_(smooth, smooth)], rtol=1e-6, atol=1e-7
    )
    # what stops the controller when it is not zero has no slope
    assert np.flatnonzero(slope.switches).tolist() == [memory[3]]
    np.testing.assert_array_equal(one_period.variables(section), before)


def test_a_choice_of_variables_is_a_part_of_the_whole(loop):
    diagram, one_period, *_ = loop
    section, chosen = after_ticks(diagram, 3), np.array([0, 1, 6])
    whole, part = one_period.derivative(section), one_period.derivative(section, chosen)
    np.testing.assert_array_equal(part.A, whole.A[np.ix_(chosen, chosen)])
