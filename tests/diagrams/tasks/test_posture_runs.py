"""Posture control over a second: distance from limits, conditioning, large errors, poles."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.scenario import GainParameters, LawGains, PostureParameters

PANDA = "pfc_panda_7r"
AT_LIMIT = [-40.0, 100.0, 140.0, -120.0, -120.0, 80.0, 0.0]
ASIDE = [-90.0, 60.0, 90.0, -110.0, -40.0, 110.0, 20.0]


@pytest.fixture(name="run")
def fixture_run(load_exact_scenario):
    """Return a function that drives the seven rigid axes with a posture, and its station."""

    def run(start, duration, *, dwell=0.05, **posture):
        settings = load_exact_scenario(PANDA)
        settings.start.offset, settings.start.rotation_deg = [0.0, 0.0], [0.0, 0.0, 0.0]
        settings.start.posture_deg = start
        settings.reference.dwell, settings.reference.velocity = dwell, 0.6
        settings.reference.acceleration = 3.0
        settings.controller.posture = PostureParameters(**posture)
        settings.simulation.fused = True
        station = build_station(settings, Path())
        simulator = Simulator(station.diagram)
        root = simulator.get_mutable_context()
        station.set_start(root)
        simulator.AdvanceTo(duration)
        return station, station.fault(root), station.log.read(root)[1]

    return run


def margin(station, log):
    """Return the least distance from a joint limit at every sample [deg]."""
    q = log["joint_state"][:, : station.robot.dimension]
    lower, upper = station.robot.gather("position_limits").T
    return np.rad2deg(np.minimum(q - lower, upper - q).min(axis=1))


def deviation(station, log):
    """Return the largest distance from the path [m]."""
    xi = log["law"][:, station.law.layout.manifold_state][:, 1:3]
    return np.linalg.norm(xi, axis=1).max()


@pytest.mark.slow
def test_away_from_the_limits_of_joints(run):
    """Where it starts, 11 deg from a limit, the way leads joint 2 over it."""
    station, fault, log = run(AT_LIMIT, 1.0)
    assert fault.startswith("joint 2 'joint_2' is at its limit of 101.0 deg")
    station, fault, log = run(AT_LIMIT, 1.0, task="limits")
    assert fault is None
    away = margin(station, log)
    assert away[0] == pytest.approx(11.4, abs=0.1)
    assert away.min() > away[0] - 0.1 and away[-1] > 30.0
    assert deviation(station, log) < 5e-5


@pytest.mark.slow
def test_to_where_the_outputs_are_easy_to_move(run):
    station, fault, log = run(ASIDE, 1.5, dwell=2.0, task="conditioning", damping=5.0)
    assert fault is None
    rcond = log["law"][:, station.law.layout.status][:, 1]
    assert rcond[0] == pytest.approx(0.3155, abs=1e-3)
    assert rcond[-1] > 0.34
    assert deviation(station, log) < 5e-5


@pytest.mark.slow
@pytest.mark.parametrize(
    "posture",
    [
        {"reference_deg": [120.0, -40.0, -120.0, -130.0, 0.0, 110.0, 45.0]},
        {
            "task": "limits",
            "weight": "range",
            "damping": 5.0,
            "inertia": 0.3,
            "stiffness": 100.0,
        },
    ],
)
def test_a_posture_far_away_does_not_take_the_tool_off_its_path(run, posture):
    """Unbounded, the pull took it 160 mm, and 900 mm, off."""
    station, fault, log = run(AT_LIMIT, 1.0, **posture)
    assert fault is None
    assert deviation(station, log) < 5e-5
    n = station.robot.dimension
    speed = np.abs(log["posture_reference"][:, n : 2 * n]).max(axis=0)
    assert np.all(speed < 0.55 * station.robot.gather("velocity_limit"))
    assert speed.max() > 0.5


@pytest.mark.slow
def test_an_elbow_that_hardly_moves_alone_leaves_the_joints_to_the_tool(run):
    """With a stiff posture a joint exceeds its largest speed in each revolution."""
    start = [0.0, -20.0, 0.0, -130.0, 0.0, 110.0, 45.0]
    station, fault, log = run(start, 1.65, task="elbow")
    assert fault is None
    assert deviation(station, log) < 5e-5
    n = station.robot.dimension
    speed = np.abs(log["joint_state"][:, n : 2 * n]).max(axis=0)
    shares = speed / station.robot.gather("velocity_limit")
    assert 0.5 < shares.max() < 0.85


@pytest.mark.slow
@pytest.mark.parametrize("own", [GainParameters(bandwidth=20.0), GainParameters()])
def test_poles_are_chosen_for_more_joints_than_outputs(load_scenario, own):
    settings = load_scenario("pfc_elastic_7r")
    kinds = [GainParameters(bandwidth=60.0) for _ in range(3)]
    settings.controller.gains = {"elastic": LawGains(*kinds, own)}
    station = build_station(settings, Path())
    found = settings.controller.gains["elastic"]
    assert found.eta.poles == found.xi.poles == found.phi.poles
    assert found.eta.poles[:2] == [-60.0, -60.0] and found.eta.poles[3] < -150.0
    slow = -20.0 if own.bandwidth else -60.0
    expected = np.poly([slow, slow, *found.xi.poles[2:]])[:0:-1]
    posture = station.law.posture.stabilization.proportional
    np.testing.assert_allclose(posture, np.outer(expected, np.ones(7)), rtol=1e-9)
