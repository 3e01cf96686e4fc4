"""Forces on the robot, at its tool and on its links."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.analysis import Simulator
from scipy.integrate import solve_ivp

from diagrams.builder import build_station
from diagrams.scenario import ForcePulse, LinkHandParameters, Scenario
from experiments.results.run_signals import collect_log
from experiments.simulation import simulate
from pfsc_drake.errors import InputError

SCENARIOS = Path(__file__).parents[3] / "experiments" / "scenarios"
POINT = [0.1, 0.0, 0.05]
PULSE = ForcePulse(0.02, 0.1, [60.0, 80.0, -40.0], [1.0, 2.0, 3.0], 0.02, "world", "link_3", POINT)


def run(settings, duration):
    settings.simulation.integrator, settings.simulation.max_step = "runge_kutta3", 1e-3
    station = build_station(settings, SCENARIOS)
    result = simulate(station, settings.simulation, duration, lambda *_: None)
    assert result.fault is None
    return station, collect_log(station, result.root)


@pytest.fixture
def three_axes(load_exact_scenario) -> Scenario:
    """Three rigid axes that rest on the path."""
    settings = load_exact_scenario("pfc_elastic_3r")
    settings.robot.model, settings.controller.law = "comau_racer_1_4_3r", "rigid"
    settings.controller.boundary_layer_damping = []
    settings.forces, settings.start.offset = [], [0.0, 0.0]
    return settings


@pytest.fixture
def six_axes(load_exact_scenario) -> Scenario:
    """Six elastic axes that rest on the path."""
    settings = load_exact_scenario("pfc_elastic_6r")
    settings.start.offset, settings.start.rotation_deg = [0.0, 0.0], [0.0, 0.0, 0.0]
    return settings


@pytest.mark.slow
def test_a_push_moves_the_arm_as_in_drakes_own_simulation(three_axes, load_arm):
    """The same drive torques and force on a plant of its own, integrated tick by tick."""
    three_axes.forces = [PULSE]
    _, log = run(three_axes, 0.1)
    arm = load_arm("comau_racer_1_4_3r")
    frame, world = arm.plant.GetFrameByName("link_3"), arm.plant.world_frame()
    x = np.concatenate([log["q_J"].values[0], log["v_J"].values[0]])
    moved = []
    for k in range(len(log.time) - 1):
        # the log has what was held up to its time
        force, torque = log["push_force"].values[k + 1], PULSE.at(log.time[k]).full().ravel()[3:]
        tau_d = log["tau_d"].values[k]

        def rate(_, state, force=force, torque=torque, tau_d=tau_d):
            arm.set_state(state)
            J = arm.plant.CalcJacobianSpatialVelocity(
                arm.context, JacobianWrtVariable.kV, frame, POINT, world, world
            )
            tau = tau_d + J.T @ np.concatenate([torque, force])
            tau += arm.plant.CalcGravityGeneralizedForces(arm.context)
            tau -= arm.plant.CalcBiasTerm(arm.context)
            acceleration = np.linalg.solve(arm.plant.CalcMassMatrix(arm.context), tau)
            return np.concatenate([state[3:], acceleration])

        x = solve_ivp(rate, (0.0, 1e-3), x, rtol=1e-9, atol=1e-12).y[:, -1]
        moved.append(x)
    moved = np.array(moved)
    assert np.abs(moved[-1, :3] - log["q_J"].values[0]).max() > 1e-4
    assert np.allclose(moved[:, :3], log["q_J"].values[1:], rtol=0, atol=1e-7)
    assert np.allclose(moved[:, 3:], log["v_J"].values[1:], rtol=0, atol=1e-5)
    assert log["push_point"].dim == log["push_force"].dim == 3


@pytest.mark.slow
@pytest.mark.parametrize("source", ["known", "observed"])
def test_a_law_that_knows_of_a_push_stays_on_the_path(six_axes, source):
    """Two pulses and a hand on different links; beside the joint torques their time derivatives."""
    six_axes.forces = [
        PULSE,
        ForcePulse(0.05, 0.15, [0.0, -50.0, 0.0], ramp=0.02, link="link_3", point=POINT),
        ForcePulse(0.05, 0.15, [20.0, 0.0, 0.0], ramp=0.02),
    ]
    six_axes.pushes = [
        LinkHandParameters("link_4", way=[0.0, 0.1, 0.0], duration=0.05, grip_ramp=0.05)
    ]
    _, ignorant = run(six_axes, 0.15)
    six_axes.controller.external_torque.source = source
    six_axes.controller.external_torque.bandwidth = 400.0
    station, log = run(six_axes, 0.15)
    off = [np.linalg.norm(each["xi"].values, axis=1).max() for each in (ignorant, log)]
    assert off[0] > 100e-6
    assert off[1] < 0.1 * off[0]
    assert log["push_force"].labels[::3] == ["link_3 x", "link_4 x"]
    assert np.abs(log["push_force"].values[:, 3:]).max() > 10.0
    has_input = station.controllers[0].HasSubsystemNamed("external_torque")
    assert has_input == (source == "known")


@pytest.mark.slow
def test_pushes_reach_a_plant_with_coupled_rotors(six_axes):
    """As torques on the link side; with a force on the tool they add up."""
    six_axes.robot.rotor_coupling = "comau_racer_1_4"
    six_axes.forces = [PULSE, ForcePulse(0.0, 0.1, [20.0, 0.0, 0.0], ramp=0.02)]
    station = build_station(six_axes, SCENARIOS)
    root = station.diagram.CreateDefaultContext()
    station.set_start(root)
    root.SetTime(0.05)
    station.blocks.set_state(root, "push_hold.held", PULSE.at(0.05).full().ravel())
    station.blocks.set_state(root, "wrench_hold.held", np.array([20.0, 0, 0, 0, 0, 0]))
    pushes, tool, plant = (
        station.diagram.GetSubsystemByName(name)
        for name in ("link_pushes", "external_wrench", "plant")
    )
    parts = [s.GetOutputPort("tau_ext").Eval(s.GetMyContextFromRoot(root)) for s in (pushes, tool)]
    context = plant.GetMyContextFromRoot(root)
    assert np.allclose(plant.GetInputPort("external_torque").Eval(context), sum(parts))
    assert all(np.abs(part).max() > 1.0 for part in parts)


def test_forces_on_links_are_in_manifold_axes_if_requested(three_axes):
    pulse = ForcePulse(0.0, 0.1, [0.0, 50.0, 0.0], ramp=0.02, frame="manifold", link="link_2")
    three_axes.forces = [pulse]
    station, log = run(three_axes, 0.06)
    y_t, theta = log["y_t"].values[0].tolist(), station.initial_projection[0]
    axes = station.task.manifold.axes(np.array(station.path.evaluator(2)(y_t, theta))).full()
    assert log["push_force"].values[-1] == pytest.approx(axes @ [0.0, 50.0, 0.0], abs=0.1)


@pytest.mark.slow
def test_what_cannot_be_pushed_is_refused(three_axes, load_scenario):
    three_axes.forces = [ForcePulse(link="link_2"), ForcePulse(link="elbow")]
    with pytest.raises(
        InputError, match=r"forces\[1\]\.link = 'elbow' is not .*allowed: link_1, link_2"
    ):
        build_station(three_axes, SCENARIOS)
    three_axes.forces, three_axes.pushes = [], [LinkHandParameters("base")]
    with pytest.raises(InputError, match=r"pushes\[0\]\.link = 'base' does not move .*link_1"):
        build_station(three_axes, SCENARIOS)
    coupled = load_scenario("pfc_elastic_6r")
    coupled.robot.rotor_coupling = "comau_racer_1_4"
    coupled.controller.external_torque.source = "measured"
    coupled.forces = [ForcePulse(link="tool")]
    with pytest.raises(InputError, match=r"forces\[0\]\.link = 'tool' with robot\.rotor_coupling"):
        build_station(coupled, SCENARIOS)
    delta = load_scenario("pfc_delta")
    delta.forces = [ForcePulse(link="link_2")]
    with pytest.raises(InputError, match=r"forces\[0\]\.link = 'link_2'; allowed: none"):
        build_station(delta, SCENARIOS)


def test_a_law_that_does_not_know_of_pushes_warns(six_axes):
    six_axes.forces = [PULSE]
    for source, warned in (("none", True), ("measured", True), ("known", False)):
        six_axes.controller.external_torque.source = source
        warnings = build_station(six_axes, SCENARIOS).warnings
        assert any("forces act on links" in line for line in warnings) == warned


@pytest.mark.slow(but="known")
@pytest.mark.parametrize("source", ["known", "observed"])
def test_the_posture_receives_pushes(six_axes, source):
    """With every source of the law's external torque."""
    six_axes.forces = [PULSE]
    six_axes.controller.posture.yields = source
    six_axes.controller.posture.observer_rate = 300.0
    station = build_station(six_axes, SCENARIOS)
    simulator = Simulator(station.diagram)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.AdvanceTo(0.075)

    pushes = station.diagram.GetSubsystemByName("link_pushes")
    truth = pushes.GetOutputPort("tau_ext").Eval(pushes.GetMyContextFromRoot(root))
    assert np.abs(truth).max() > 10.0
    if source == "known":
        assert np.array_equal(
            station.blocks.output(root, "controller.external_torque_of_posture.tau_ext"), truth
        )
    else:
        seen = station.blocks.output(root, "controller.posture_torque_observer.estimate")
        assert np.allclose(seen, truth, rtol=0, atol=0.1 * np.abs(truth).max())
