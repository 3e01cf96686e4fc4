"""Posture parameters of a scenario."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from diagrams.builder import build_station
from diagrams.scenario import ControllerParameters, GainParameters, LawGains, PostureParameters
from pfsc_drake.control.law.loop_at_rest import RestPosture
from pfsc_drake.control.law.posture import range_weight
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.controller.law import make_law
from pfsc_drake.errors import InputError
from pfsc_drake.jets import Jet
from pfsc_drake.yaml.fields import OneForAll
from tests.control.conftest import BENT_7
from tests.scenarios import LONG

XI = [-4.0, -6.0]


def law_of(load_arm, posture=None, gains=None, rest=None, robot="franka_emika_panda"):
    xi = GainParameters(poles=XI, integral_pole=-1.0)
    by_kind = {"eta": xi, "xi": xi, "phi": xi} | ({} if gains is None else {"posture": gains})
    parameters = ControllerParameters(law="rigid", gains={"rigid": LawGains(**by_kind)})
    parameters.posture = posture or PostureParameters()
    return make_law(parameters, load_arm(robot).chain, PathManifold(2, oriented=True), rest)


def proportional(poles):
    return np.poly(poles)[:0:-1]


def test_joints_have_the_poles_of_xi_without_integral_part_unless_they_have_their_own(load_arm):
    own = law_of(load_arm).posture.stabilization
    assert np.allclose(own.proportional.T, [proportional(XI)] * 7)
    assert not own.has_integral_part
    own = law_of(load_arm, gains=GainParameters(poles=[-9.0, -11.0])).posture.stabilization
    assert np.allclose(own.proportional.T, [proportional([-9.0, -11.0])] * 7)
    assert law_of(load_arm).stabilization.has_integral_part


def test_gains_of_a_posture_are_checked(load_arm):
    with pytest.raises(
        InputError,
        match=r"controller.gains.rigid.posture.poles = \[-9\.0\]; allowed: 2 negative numbers",
    ):
        law_of(load_arm, gains=GainParameters(poles=[-9.0]))
    with pytest.raises(InputError, match=r"posture = -3\.0; allowed: gains without an integral"):
        LawGains(posture=GainParameters(poles=[-9.0, -9.0], integral_pole=-3.0))


def test_weights(load_arm):
    chain = load_arm("franka_emika_panda").chain
    assert np.array_equal(law_of(load_arm).posture.weight, np.ones(7))
    by_range = law_of(load_arm, PostureParameters(weight="range")).posture.weight
    assert np.array_equal(by_range, range_weight(chain))
    assert law_of(load_arm, PostureParameters(weight="inertia")).posture.weight is None
    own = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]
    given = law_of(load_arm, PostureParameters(joint_weights=own)).posture.weight
    assert np.array_equal(given, own)
    with pytest.raises(InputError, match=r"joint_weights = .*; allowed: 7 values, one per joint"):
        law_of(load_arm, PostureParameters(joint_weights=[1.0, 2.0]))


def test_one_number_for_all_joints_and_poles(load_arm):
    given = law_of(load_arm, PostureParameters(joint_weights=OneForAll([2.0]))).posture.weight
    assert np.array_equal(given, [2.0] * 7)
    own = law_of(load_arm, gains=GainParameters(poles=OneForAll([-9.0]))).posture.stabilization
    assert np.allclose(own.proportional.T, [proportional([-9.0, -9.0])] * 7)


def test_a_square_robot_has_no_posture(load_arm):
    assert law_of(load_arm, robot="comau_racer_1_4").posture is None


def test_an_elbow_is_a_coordinate_of_arms_with_one(load_arm):
    rest = RestPosture(np.array(BENT_7), np.zeros(0))
    law = law_of(load_arm, PostureParameters(task="elbow"), rest=lambda: rest)
    assert law.posture.coordinate is not None
    assert law_of(load_arm).posture.coordinate is None
    with pytest.raises(InputError, match=r"elbow_joints = \[2, 4, 8\]; the robot has 7 joints"):
        law_of(load_arm, PostureParameters(task="elbow", elbow_joints=[2, 4, 8]), rest=lambda: rest)
    with pytest.raises(InputError, match="needs a start"):
        law_of(load_arm, PostureParameters(task="elbow"))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("task", "knee"),
        ("weight", "mass"),
        ("yields", "measured"),
        ("reference_deg", [1e5]),
        ("joint_weights", [0.0, 1.0]),
        ("elbow_joints", [4, 2, 6]),
        ("inertia", 0.0),
        ("damping", -1.0),
        ("stiffness", -1.0),
        ("filter_rate", 0.0),
        ("observer_rate", np.inf),
    ],
)
def test_what_is_out_of_range_is_refused(key, value):
    with pytest.raises(InputError, match=rf"^{key} = "):
        PostureParameters(**{key: value})


def test_weights_are_given_in_one_way():
    with pytest.raises(InputError, match="empty where weight is given"):
        PostureParameters(weight="range", joint_weights=[1.0])


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ([0.0], r"reference_deg = \[0\.0\]; allowed: 7 values, one per joint"),
        (
            [0, -45, 0, 10, 0, 90, 45],
            r"reference_deg: 10 of joint_4; its limits are -176 to -4 deg",
        ),
    ],
)
def test_a_reference_out_of_reach_is_refused(reference, message, load_scenario):
    settings = load_scenario("pfc_panda_7r")
    settings.controller.posture.reference_deg = reference
    with pytest.raises(InputError, match=message):
        build_station(settings, Path())


def run(settings, duration):
    """Return a station and its logged signals after a run."""
    settings.simulation.fused = duration >= LONG
    station = build_station(settings, Path())
    simulator = Simulator(station.diagram)
    root = simulator.get_mutable_context()
    station.set_start(root)
    simulator.Initialize()
    simulator.AdvanceTo(duration)
    assert station.fault(root) is None
    return station, station.log.read(root)[1]


@pytest.fixture(name="at_rest")
def fixture_at_rest(load_exact_scenario):
    """Return a scenario of the seven-axis arm that rests on its path."""

    def make(**posture):
        settings = load_exact_scenario("pfc_panda_7r")
        settings.reference.dwell = 3.0
        settings.controller.posture = PostureParameters(**posture)
        return settings

    return make


def test_a_posture_goes_where_it_is_sent_as_far_as_the_tool_lets_it(at_rest):
    """The tool rests; the joints end where their distance to the reference cannot get less."""
    reference = [20.0, -20.0, 10.0, -120.0, 0.0, 110.0, 40.0]
    station, signals = run(at_rest(reference_deg=reference), 3.0)
    n = 7
    q, q_0 = signals["joint_state"][-1][:n], signals["posture_reference"][-1][:n]
    assert np.allclose(q_0, np.deg2rad(reference), atol=2e-3)
    A = np.array(
        station.law.linearization.function(
            signals["joint_state"][-1], np.zeros(n), signals["manifold_point"][-1]
        )[1]
    )
    free = np.linalg.svd(A)[2][-1]
    start = signals["joint_state"][0][:n]
    assert abs(free @ (start - q_0)) > 0.05
    assert abs(free @ (q - q_0)) < 2e-3
    Y = signals["law"][-1][station.law.layout.manifold_state]
    assert np.abs(Y[1:3]).max() < 1e-6


@pytest.mark.slow
def test_the_elbow_stays_while_the_tool_moves(load_exact_scenario):
    ranges, coordinate = [], None
    for task in ("elbow", "reference"):
        settings = load_exact_scenario("pfc_panda_7r")
        settings.start.posture_deg = [-90, 60, 90, -110, -40, 110, 20]  # the elbow is outside
        settings.controller.posture = PostureParameters(task=task)
        station, signals = run(settings, 3.0)
        coordinate = station.law.posture.coordinate or coordinate
        # after the start beside the path
        states = signals["joint_state"][500::100]
        ranges.append(np.ptp([swivel(coordinate, state[:7]) for state in states]))
    assert ranges[0] < 1e-4 < 0.3 < ranges[1]


def swivel(coordinate, q):
    """Return the angle of a posture."""
    return float(coordinate([Jet([x, 0.0]) for x in q]).coefficients[0])
