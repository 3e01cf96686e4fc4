"""Stability of integration schemes against Drake's integrators."""

import numpy as np
import pytest
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import LinearSystem, ZeroOrderHold

from diagrams.builder import build_station
from diagrams.integration import STABILITY, Integration, continuous_modes, is_stable
from diagrams.scenario import SimulationParameters
from pfsc_drake.robot.robot_model import joint_resonances

STEP = 1e-3


def oscillator(omega, zeta=0.0):
    return np.array([[0.0, 1.0], [-(omega**2), -2.0 * zeta * omega]])


def simulator_of(A, scheme):
    n = len(A)
    simulator = Simulator(LinearSystem(A, np.zeros((n, 0)), np.eye(n), np.zeros((n, 0))))
    config = SimulatorConfig(integration_scheme=scheme, max_step_size=STEP, use_error_control=False)
    ApplySimulatorConfig(config, simulator)
    return simulator


def after(A, scheme, steps, x0):
    simulator = simulator_of(A, scheme)
    simulator.get_mutable_context().SetContinuousState(x0)
    simulator.AdvanceTo(steps * STEP)
    return simulator.get_context().get_continuous_state_vector().CopyToVector()


@pytest.mark.parametrize("scheme", STABILITY)
@pytest.mark.parametrize("omega", [50.0, 700.0, 1500.0])
def test_polynomials_are_those_of_drakes_schemes(scheme, omega):
    A, x0 = oscillator(omega, zeta=0.1), np.array([1.0, -3.0])
    powers = [np.linalg.matrix_power(A * STEP, k) for k in range(len(STABILITY[scheme]))]
    R = sum(c * power for c, power in zip(STABILITY[scheme], powers, strict=True))
    np.testing.assert_allclose(after(A, scheme, 1, x0), R @ x0, rtol=1e-12, atol=1e-12)


def test_schemes_are_in_order_of_cost():
    def evaluations(scheme):
        simulator = simulator_of(oscillator(50.0), scheme)
        simulator.get_mutable_context().SetContinuousState([1.0, 0.0])
        simulator.AdvanceTo(0.1)
        return simulator.get_integrator().get_num_derivative_evaluations()

    costs = [evaluations(scheme) for scheme in STABILITY]
    assert costs == sorted(set(costs))


@pytest.mark.parametrize(
    ("scheme", "omega", "stable"),
    [
        ("runge_kutta2", 100.0, True),
        ("runge_kutta2", 250.0, False),
        ("runge_kutta3", 1300.0, True),
        ("runge_kutta3", 1800.0, False),
        ("runge_kutta5", 750.0, True),
        ("runge_kutta5", 1300.0, False),
    ],
)
def test_undamped_oscillations_do_not_grow(scheme, omega, stable):
    """Judged by the modes, and seen in a second of simulation."""
    A = oscillator(omega)
    assert is_stable(scheme, STEP, np.linalg.eigvals(A)) == stable
    grown = after(A, scheme, 1000, np.array([1.0, 0.0])) / np.array([1.0, omega])
    assert (np.linalg.norm(grown) < 1.1) == stable


@pytest.mark.parametrize("scheme", STABILITY)
def test_what_grows_by_itself_is_no_matter_of_the_scheme(scheme):
    """A robot above its base is an inverted pendulum."""
    assert is_stable(scheme, STEP, np.array([5.0, -5.0, 0.0, 0.0], dtype=complex))


@pytest.mark.parametrize(("scheme", "limit"), [("runge_kutta2", 2.0), ("runge_kutta3", 2.5127)])
def test_posture_has_a_margin(scheme, limit):
    """Decaying modes: a quarter faster is still stable."""
    rate = limit / (1.25 * STEP)
    assert is_stable(scheme, STEP, np.array([-0.99 * rate], dtype=complex))
    assert not is_stable(scheme, STEP, np.array([-1.01 * rate], dtype=complex))


def test_modes_of_a_diagram_with_held_inputs():
    """The loop through the hold is open between two ticks."""
    builder = DiagramBuilder()
    A, B = oscillator(30.0, 0.2), np.array([[0.0], [1.0]])
    plant = builder.AddSystem(LinearSystem(A, B, np.array([[1e3, 0.0]]), np.zeros((1, 1))))
    hold = builder.AddSystem(ZeroOrderHold(STEP, 1))
    builder.Connect(plant.get_output_port(), hold.get_input_port())
    builder.Connect(hold.get_output_port(), plant.get_input_port())
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    x0 = np.array([0.3, -2.0])
    root.SetContinuousState(x0)
    modes = continuous_modes(diagram, root)
    expected = 30.0 * (-0.2 + 1j * np.sqrt(1.0 - 0.2**2) * np.array([-1.0, 1.0]))
    np.testing.assert_allclose(np.sort_complex(modes), expected, rtol=1e-7)
    np.testing.assert_array_equal(root.get_continuous_state_vector().CopyToVector(), x0)


def test_modes_of_elastic_joints_are_their_resonances(load_scenario):
    scenario = load_scenario("pfc_elastic_3r")
    station = build_station(scenario, None)
    root = station.diagram.CreateDefaultContext()
    station.set_start(root)
    modes = continuous_modes(station.diagram, root)
    q_J = (station.part.coordinates.link_rows @ station.initial_state)[: station.robot.dimension]
    fastest = joint_resonances(station.robot, q_J)[-1]
    assert np.abs(modes).max() == pytest.approx(fastest, rel=1e-2)  # gravity stiffens a little


def test_integration_says_what_and_why():
    integration = Integration("runge_kutta3", 5e-4, "because")
    assert str(integration) == "runge_kutta3 in steps of 0.5 ms: because"
    applied = integration.applied_to(SimulationParameters(frame_period=0.1))
    assert applied == SimulationParameters("runge_kutta3", 5e-4, frame_period=0.1)
