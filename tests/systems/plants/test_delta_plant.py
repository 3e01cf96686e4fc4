"""The analytic DELTA plant: energy, equilibrium, forces."""

import numpy as np
import pytest
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator

from pfsc_drake.robot.delta.delta_parameters import load_delta_parameters
from pfsc_drake.robot.delta.delta_robot import DeltaRobot
from pfsc_drake.systems.plants.delta_plant import DeltaPlant

M_Q, M_Y, GRAVITY = 1.1, 1.85, 9.81
SINK = 0.325 / np.hypot(0.416, 0.325)


@pytest.fixture(scope="module")
def robot():
    return DeltaRobot(load_delta_parameters())


def simulate(plant, q, v, force, f_ext, duration, accuracy=1e-10):
    """Return the state and tool position at the end, under constant forces."""
    simulator = Simulator(plant)
    ResetIntegratorFromFlags(simulator, "runge_kutta3", 1e-3)
    simulator.get_mutable_integrator().set_target_accuracy(accuracy)
    context = simulator.get_mutable_context()
    plant.set_state(context, q, v)
    plant.GetInputPort("actuation").FixValue(context, force)
    if f_ext is not None:
        plant.GetInputPort("external_force").FixValue(context, f_ext)
    simulator.AdvanceTo(duration)
    state = plant.GetOutputPort("state").Eval(context)
    return state, plant.GetOutputPort("tool_position").Eval(context)


def energy(robot, state):
    """T + V of (2.68), (2.69), the tool's velocity by differences."""
    q, v = state[:3], state[3:]
    y_rate = (robot.tool_position(q + 1e-6 * v) - robot.tool_position(q - 1e-6 * v)) / 2e-6
    kinetic = 0.5 * (M_Q * v @ v + M_Y * y_rate @ y_rate)
    return kinetic - GRAVITY * (M_Y * robot.tool_position(q)[2] + M_Q * SINK * np.sum(q))


def test_energy_is_conserved_without_drives(robot):
    start = np.array([0.10, 0.16, 0.13, -1.2, -0.8, -1.0])
    plant = DeltaPlant(robot)
    state, _ = simulate(plant, start[:3], start[3:], np.zeros(3), None, 0.3)
    assert np.linalg.norm(state - start) > 0.1, "a motion worth the name"
    assert energy(robot, state) == pytest.approx(energy(robot, start), abs=2e-8)


def test_work_of_the_forces_becomes_energy(robot):
    """Constant forces: the work is force times way."""
    force, f_ext = np.array([-12.0, -20.0, -9.0]), np.array([4.0, -3.0, 6.0])
    start = np.concatenate([[0.15, 0.2, 0.18], np.zeros(3)])
    state, y_t = simulate(DeltaPlant(robot), start[:3], None, force, f_ext, 0.4)
    travel, tool_travel = state[:3] - start[:3], y_t - robot.tool_position(start[:3])
    work = force @ travel + f_ext @ tool_travel
    assert abs(f_ext @ tool_travel) > 0.1 and abs(force @ travel) > 0.1
    assert energy(robot, state) - energy(robot, start) == pytest.approx(work, abs=2e-8)


def test_holding_forces_keep_the_robot_at_rest(robot):
    """Weight at the tool is what J' m_y g says, found here by differences of the potential."""
    q = np.array([0.12, 0.2, 0.16])
    hold = [
        -(energy(robot, np.r_[q - e, 0, 0, 0]) - energy(robot, np.r_[q + e, 0, 0, 0])) / 2e-5
        for e in 1e-5 * np.eye(3)
    ]
    state, y_t = simulate(DeltaPlant(robot), q, None, np.array(hold), None, 0.2)
    assert np.allclose(state, np.r_[q, 0, 0, 0], rtol=0, atol=1e-7)
    assert np.allclose(y_t, robot.tool_position(q), rtol=0, atol=1e-7)
    # an external force upwards of the same size as the tool's weight takes its part over
    lifted = np.full(3, -M_Q * GRAVITY * SINK)
    state, _ = simulate(DeltaPlant(robot), q, None, lifted, np.array([0, 0, -M_Y * GRAVITY]), 0.2)
    assert np.allclose(state, np.r_[q, 0, 0, 0], rtol=0, atol=1e-9)


def test_ports_and_default_state(robot):
    plant = DeltaPlant(robot)
    assert plant.GetInputPort("actuation").size() == 3
    assert plant.GetInputPort("external_force").size() == 3
    context = plant.CreateDefaultContext()
    assert plant.num_continuous_states() == 6
    assert context.num_total_states() == 6
    # outputs of the state need no input: no algebraic loops
    for name in ("state", "tool_position", "acceleration"):
        needs_inputs = plant.HasDirectFeedthrough(plant.GetOutputPort(name).get_index())
        assert needs_inputs == (name == "acceleration")
    state = plant.GetOutputPort("state").Eval(context)
    assert np.allclose(state, [0.2, 0.2, 0.2, 0.0, 0.0, 0.0], rtol=0, atol=1e-15)
    y_t = plant.GetOutputPort("tool_position").Eval(context)
    assert np.allclose(y_t, robot.tool_position(state[:3]), rtol=0, atol=1e-15)


def test_two_contexts_of_one_plant_do_not_share_results(robot):
    plant = DeltaPlant(robot)
    contexts = [plant.CreateDefaultContext() for _ in range(2)]
    positions = [np.array([0.1, 0.2, 0.3]), np.array([0.25, 0.15, 0.05])]
    for context, q in zip(contexts, positions, strict=True):
        plant.set_state(context, q)
    results = [plant.GetOutputPort("tool_position").Eval(context) for context in contexts]
    for result, q in zip(results, positions, strict=True):
        assert np.allclose(result, robot.tool_position(q), rtol=0, atol=1e-15)


@pytest.mark.parametrize(("force", "end"), [(-60.0, "q = -0.0"), (60.0, "q = 0.4")])
def test_leaving_the_travel_ends_the_simulation_with_a_reason(robot, force, end):
    """In front of the singular configuration, where steps would become ever smaller."""
    with pytest.raises(RuntimeError, match=rf"slide 2 left its travel at t = 0\.\d+ s: {end}"):
        simulate(DeltaPlant(robot), np.full(3, 0.2), None, [-13.0, force, -13.0], None, 5.0)


def test_a_state_that_is_not_finite_ends_the_simulation(robot):
    with pytest.raises(RuntimeError, match="slide 1 left its travel"):
        simulate(DeltaPlant(robot), np.full(3, np.nan), None, np.zeros(3), None, 0.1)


def test_the_ends_of_the_travel_belong_to_it(robot):
    for q, out in (([0.0, 0.1, 0.2], -2e-9), ([0.4, 0.3, 0.35], 2e-9)):
        state, _ = simulate(DeltaPlant(robot), np.array(q), None, np.zeros(3), None, 0.0)
        np.testing.assert_array_equal(state[:3], q)
        beyond = np.array([q[0] + out, *q[1:]])
        with pytest.raises(RuntimeError, match="slide 1 left its travel"):
            simulate(DeltaPlant(robot), beyond, None, np.zeros(3), None, 0.0)


def test_where_the_rods_cannot_meet_the_derivatives_are_not_finite(robot):
    longer = load_delta_parameters()
    longer.geometry.l_BC = 0.3
    plant = DeltaPlant(DeltaRobot(longer))
    context = plant.CreateDefaultContext()
    plant.set_state(context, np.zeros(3))
    plant.GetInputPort("actuation").FixValue(context, np.zeros(3))
    rate = plant.EvalTimeDerivatives(context).CopyToVector()
    assert not np.isfinite(rate[3:]).any()
