"""A hand in a station: its force, its delay, and its sum with scripted forces."""

from pathlib import Path

import numpy as np
import pytest

from diagrams.builder import build_station
from diagrams.scenario import (
    ForcePulse,
    HandParameters,
    HandWaypoint,
    Line,
    Scenario,
)
from diagrams.scenario_task import make_task
from experiments.results.run_signals import collect_log
from experiments.simulation import simulate
from pfsc_drake.control.compliance.impedance_parameters import CoordinateImpedance, Profile
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.typed import load_typed

SCENARIOS = Path(__file__).parents[3] / "experiments" / "scenarios"
TICK = 1e-3


def steady_hand(target, **changes):
    """Return a hand that holds on to one point from the start."""
    options = {"waypoints": [HandWaypoint(0.0, target)], "grip_ramp": 0.05, "damping": 20.0}
    return HandParameters(**options | changes)


@pytest.fixture
def settings(load_scenario, load_exact_scenario) -> Scenario:
    """Three rigid axes that rest on the path."""
    settings = load_exact_scenario("operator_hand_6r")
    settings.robot.model = "comau_racer_1_4_3r"
    settings.path = load_scenario("pfc_elastic_3r").path
    settings.start.posture_deg = [15, 115, -10]
    settings.reference.points = [0.96, 0.96]
    settings.sensor.noise = np.zeros(6)
    settings.hand = None
    return settings


def run(settings, duration, folder=SCENARIOS):
    station = build_station(settings, folder)
    result = simulate(station, settings.simulation, duration, lambda *_: None)
    assert result.fault is None
    return station, collect_log(station, result.root)


@pytest.mark.slow
def test_a_stiff_robot_is_pulled_by_the_whole_spring(settings):
    """Without compliance: 300 N/m times 40 mm, in world axes; with a pulse on top."""
    settings.compliance.tangential = CoordinateImpedance()
    settings.compliance.transversal = CoordinateImpedance()
    station = build_station(settings, SCENARIOS)
    pose = station.part.tool.CalcPoseInWorld
    context = station.part.model.CreateDefaultContext()
    station.part.model.SetPositionsAndVelocities(context, station.initial_state)
    start = pose(context).translation()
    settings.hand = steady_hand(start + np.array([0.0, 0.04, 0.0]))
    settings.forces = [ForcePulse(0.1, 0.3, np.array([5.0, 0.0, 0.0]), ramp=0.02)]
    _, log = run(settings, 0.4)
    wrench = log["wrench_ext"].values
    held = log.time > 0.35
    np.testing.assert_allclose(wrench[held], [[0, 12.0, 0, 0, 0, 0]] * held.sum(), atol=0.05)
    both = (log.time > 0.15) & (log.time < 0.25)
    np.testing.assert_allclose(wrench[both, :3], [[5.0, 12.0, 0.0]] * both.sum(), atol=0.1)
    assert np.abs(wrench[0]).max() == 0.0


@pytest.mark.slow
def test_springs_of_hand_and_tool_share_the_displacement(settings):
    """At rest k xi = K (xi_d - xi); along the path the tool arrives, for nothing holds it."""
    k, K = 1500.0, 500.0
    soft = CoordinateImpedance(Profile(2.0), Profile(60.0), Profile(0.0))
    settings.simulation.fused = True
    settings.compliance.tangential = soft
    settings.compliance.transversal = CoordinateImpedance(Profile(2.0), Profile(120.0), Profile(k))
    settings.hand = HandParameters(
        waypoints=[
            HandWaypoint(0.1, [0.96, 0.0, 0.0]),
            HandWaypoint(0.6, [1.01, 0.0, 0.02]),
        ],
        frame="manifold",
        stiffness=K,
        damping=30.0,
    )
    _, log = run(settings, 1.6)
    late = log.time > 1.55
    np.testing.assert_allclose(log["eta"].values[late], 1.01, atol=1e-3)
    share = 0.02 * K / (K + k)
    np.testing.assert_allclose(log["xi"].values[late, 1], share, rtol=0.05)
    np.testing.assert_allclose(log["manifold_force"].values[late, 2], k * share, rtol=0.05)


@pytest.mark.slow
def test_the_hand_sees_the_links_and_the_truth(settings, load_scenario):
    """Not the encoders, and not the motors, which are where the rigid law looks."""
    settings.robot.model = "comau_racer_1_4_elastic_3r"
    settings.compliance.tangential = CoordinateImpedance()
    settings.compliance.transversal = CoordinateImpedance()
    settings.encoders.link_increments = [500.0]
    settings.hand = steady_hand([0.7, 0.1, 0.9], stiffness=100.0, force_limit=1e3)
    station = build_station(settings, SCENARIOS)
    result = simulate(station, settings.simulation, 0.05, lambda *_: None)
    diagram, root = station.diagram, result.root
    view = diagram.GetSubsystemByName("hand_view")
    seen = view.GetOutputPort("tool_pose").Eval(view.GetMyContextFromRoot(root))
    plant = station.part.model
    X_WT = station.part.tool.CalcPoseInWorld(plant.GetMyContextFromRoot(root))
    np.testing.assert_allclose(seen[:3], X_WT.translation(), atol=1e-12)


def test_three_ticks_late(settings):
    """Its grip is zero at 0; seen at 1 ms, held from then on, and applied from 2 ms on.

    The log holds what acted before its sample.
    """
    settings.compliance.tangential = CoordinateImpedance()
    settings.compliance.transversal = CoordinateImpedance()
    settings.hand = steady_hand([0.7, 0.1, 0.9], grip_ramp=1e-4)
    _, log = run(settings, 0.01)
    acting = np.linalg.norm(log["wrench_ext"].values, axis=1) > 0.0
    first = log.time[np.argmax(acting)]
    assert first == pytest.approx(3.0 * TICK, abs=1e-9)


@pytest.mark.slow
def test_the_seed_decides(settings):
    forces = []
    for seed in (1, 1, 2):
        settings.hand = steady_hand([0.7, 0.1, 0.9], tremor=1.0, seed=seed)
        forces.append(run(settings, 0.08)[1]["wrench_ext"].values)
    np.testing.assert_array_equal(forces[0], forces[1])
    assert np.abs(forces[0] - forces[2]).max() > 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"reaction_delay": 0.0015}, r"hand\.reaction_delay = 0\.0015 s: must be a multiple"),
        (
            {"waypoints": [HandWaypoint(0.0, [5.0, 0.0, 0.0])], "frame": "manifold"},
            r"hand\.waypoints\[0\]\.position = \[5\.0.*eta from 0 to ",
        ),
    ],
)
def test_hands_that_cannot_be(load_scenario, change, part):
    settings = load_scenario("operator_hand_6r")
    settings.hand = HandParameters(**change)
    with pytest.raises(InputError, match=part):
        build_station(settings, SCENARIOS)


@pytest.mark.slow
def test_an_open_path_may_be_held_at_its_very_ends(settings):
    settings.path.shape = Line([0.8, -0.1, 1.0], [0.8, 0.4, 1.0])
    settings.reference.points = [0.1, 0.1]
    ends = [HandWaypoint(0.0, [0.0, 0, 0]), HandWaypoint(1.0, [0.5, 0, 0])]
    settings.hand = HandParameters(ends, "manifold")
    assert build_station(settings, SCENARIOS).path.length == pytest.approx(0.5, rel=1e-9)
    # what is said in world axes has nothing to do with the length
    settings.hand = steady_hand([0.8, 0.0, 1.0])
    build_station(settings, SCENARIOS)


@pytest.mark.slow
def test_a_closed_path_counts_on(settings):
    """A target one revolution later is the same point."""
    wrenches = []
    revolution = make_task(settings, SCENARIOS).path.length
    for eta in (0.98, 0.98 + revolution):
        settings.hand = steady_hand([eta, 0.0, 0.01], frame="manifold", grip_ramp=0.005)
        wrenches.append(run(settings, 0.02)[1]["wrench_ext"].values)
    assert np.abs(wrenches[0][-1]).max() > 1.0
    np.testing.assert_allclose(wrenches[1], wrenches[0], atol=1e-6)


@pytest.mark.parametrize(
    ("data", "part"),
    [
        ({"stiffness": 0.0}, r"hand\.stiffness = 0\.0; allowed: above 0"),
        ({"frame": "tool"}, r"hand\.frame = tool; allowed: world, manifold"),
        ({"waypoints": []}, r"hand\.waypoints = \[\]; allowed: one or more"),
        ({"waypoints": [{"time": 0.0, "position": [1.0]}]}, "allowed: 3 finite numbers"),
        ({"strength": 1.0}, r"unknown key 'hand\.strength'"),
    ],
)
def test_values_out_of_range(data, part):
    with pytest.raises(InputError, match=part) as caught:
        load_typed(Scenario, {"hand": data}, "mine.yaml")
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_the_shipped_operator(load_scenario):
    """The first two seconds: guided gently along the path."""
    settings = load_scenario("operator_hand_6r")
    settings.simulation.fused = True
    _, log = run(settings, 2.0)
    assert log["eta"].values[-1, 0] > 0.16
    assert np.linalg.norm(log["wrench_ext"].values[:, :3], axis=1).max() < 15.0
    assert np.abs(log["xi"].values - log["xi_p"].values).max() < 2e-4
    assert np.abs(log["xi"].values).max() < 2e-3
