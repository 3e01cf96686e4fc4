"""A teleoperated station: parameters, motion, energy."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from diagrams.builder import build_station
from diagrams.environment import leader
from diagrams.scenario import HandParameters, HandWaypoint
from diagrams.scenario.schema import driven
from diagrams.scenario.teleoperation import TeleoperationParameters
from diagrams.scenario_task import make_task
from experiments.results.run_signals import collect_log
from experiments.results.teleoperation_feature import teleoperation_metrics
from experiments.simulation import simulate
from pfsc_drake.control.compliance.impedance_parameters import CoordinateImpedance, Profile
from pfsc_drake.control.teleoperation.coupling_parameters import RotationParameters
from pfsc_drake.control.teleoperation.port import TeleoperationPort
from pfsc_drake.errors import InputError
from pfsc_drake.physics.channel import ChannelParameters
from pfsc_drake.physics.leader_clutch import ClutchParameters
from tests.scenarios import shipped_scenario

SCENARIOS = Path(__file__).parents[3] / "experiments" / "scenarios"


def run(settings, duration):
    station = build_station(settings, SCENARIOS)
    result = simulate(station, settings.simulation, duration, lambda *_: None)
    assert result.fault is None
    return station, collect_log(station, result.root)


def region(**teleoperation):
    """A hand that pulls the tool down by 4 cm within half a second."""
    settings = shipped_scenario("teleop_region")
    for key, value in ({"smoothing": 0.004} | teleoperation).items():
        setattr(settings.teleoperation, key, value)
    start = np.array(settings.start.position)
    settings.hand.waypoints = [
        HandWaypoint(0.5, start), HandWaypoint(1.0, start - [0.0, 0.0, 0.04])
    ]  # fmt: skip
    settings.hand.tremor = 0.0
    return settings


@pytest.mark.slow
def test_the_tool_goes_where_the_hand_is_a_channel_later():
    settings = region()
    settings.teleoperation.channel.jitter = settings.teleoperation.channel.loss = 0.0
    settings.teleoperation.channel.delay = 0.05
    station, log = run(settings, 1.8)
    still = log.time < 0.55
    assert np.ptp(log["y_t"].values[still, 2]) < 1e-4
    low = log["y_t"].values[-1, 2] - station.start.target.y_t[2]
    assert low == pytest.approx(-0.04, abs=3e-3)
    metrics = teleoperation_metrics(log, settings)
    assert 0.04 <= metrics["following_delay"].value <= 0.1
    assert metrics["audit_ports"].value < 1e-12
    assert metrics["least_port_tank"].value > 0.1
    assert metrics["energy_margin"].value >= 0.0


@pytest.mark.slow
def test_along_a_path_the_follower_moves_farther_by_the_scale():
    """And not while the clutch is open."""
    settings = shipped_scenario("teleop_path")
    settings.teleoperation.channel.delay = 0.02
    settings.teleoperation.channel.jitter = settings.teleoperation.channel.loss = 0.0
    settings.teleoperation.clutch = [ClutchParameters(1.2, 5.0)]
    settings.hand.waypoints = [
        HandWaypoint(0.4, [0.05, 0, 0]), HandWaypoint(1.0, [0.08, 0, 0]),
        HandWaypoint(1.3, [0.08, 0, 0]), HandWaypoint(1.6, [0.2, 0, 0]),
    ]  # fmt: skip
    _, log = run(settings, 1.8)
    led = log["led_point"].values
    opened = log.time >= 1.202
    assert np.ptp(led[opened], axis=0).max() < 1e-12
    before = np.linalg.norm(led[1100] - led[0])
    assert before > 0.02
    handle = np.linalg.norm(log["leader_position"].values[1100])
    assert before == pytest.approx(2.0 * handle, abs=5e-5)
    np.testing.assert_array_equal(log["leader_force"].values[opened], 0.0)


@pytest.mark.slow
def test_the_tool_turns_as_the_hand_does():
    """A hand that turns by 0.15 rad within half a second, and a wrist that turns twice as far."""
    settings = shipped_scenario("teleop_path")
    way = settings.teleoperation
    way.channel = ChannelParameters(0.02)
    way.clutch, way.motion_scale, way.force_scale = [], 1.0, 1.0
    way.rotation = RotationParameters(impedance=2.0, scale=0.5)
    settings.compliance.rotational = CoordinateImpedance(Profile(0.1), Profile(2.0), Profile(0.0))
    task = make_task(settings, SCENARIOS)
    R_0 = Rotation.from_matrix(task.start(np.zeros(3)).target.R_e)
    wanted = Rotation.from_rotvec([0.09, 0.0, 0.12]) * R_0
    settings.hand.waypoints = [
        HandWaypoint(time, [0.05, 0, 0], R.as_euler("ZYX", degrees=True))
        for time, R in ((0.4, R_0), (0.9, wanted))
    ]
    settings.hand.rotational_stiffness, settings.hand.tremor = 10.0, 0.0
    _, log = run(settings, 1.7)
    ends = {
        name: Rotation.from_matrix(log[name].values[-1].reshape(3, 3))
        for name in ("R_e", "led_orientation", "leader_orientation")
    }
    turned = (ends["R_e"] * R_0.inv()).as_rotvec()
    np.testing.assert_allclose(turned, [0.09, 0.0, 0.12], atol=0.015)
    handle = ends["leader_orientation"].as_rotvec()
    led = (ends["led_orientation"] * R_0.inv()).as_rotvec()
    np.testing.assert_allclose(led, 0.5 * handle, atol=2e-3)
    metrics = teleoperation_metrics(log, settings)
    assert metrics["led_turn_end"].value < 0.02
    assert metrics["audit_ports"].value < 1e-12
    assert metrics["energy_margin"].value >= 0.0
    # motors of the wrist by those of the port: force scale by motion scale, times that of turns
    felt, given = log["leader_moment"].values, log["port_moment"].values[:, :3]
    np.testing.assert_allclose(felt, 0.5 * given, atol=1e-12)
    assert np.abs(felt).max() > 0.05


def test_a_leader_is_limited_by_its_own_motors(monkeypatch):
    """Its port's force times the scale is the motors', its port's speed the handle's times one."""
    made = {}

    def spy(side, parameters, limits):
        made[side] = limits
        return TeleoperationPort(side, parameters, limits)

    monkeypatch.setattr(leader, "TeleoperationPort", spy)
    settings = region(motion_scale=0.4, force_scale=2.5)
    build_station(settings, SCENARIOS)
    device = settings.teleoperation.leader
    assert made["leader"].force * 2.5 == pytest.approx(device.force_limit)
    assert made["leader"].speed == pytest.approx(0.4 * device.largest_speed)


def test_turns_need_a_tool_that_yields_and_a_hand_that_turns_a_wrist():
    settings = region(rotation=RotationParameters())
    with pytest.raises(InputError, match=r"teleoperation.rotation = given"):
        build_station(settings, SCENARIOS)
    settings = region()
    settings.hand.rotational_stiffness = 5.0
    with pytest.raises(InputError, match=r"hand.rotational_stiffness = 5.0"):
        build_station(settings, SCENARIOS)


@pytest.mark.slow
@pytest.mark.parametrize("coupling", ["position_force", "four_channel"])
def test_other_couplings_lead_the_tool_too(coupling):
    settings = region(coupling=coupling)
    settings.teleoperation.channel.delay = 0.002
    settings.teleoperation.channel.jitter = settings.teleoperation.channel.loss = 0.0
    settings.teleoperation.tank.initial = 1.0
    _, log = run(settings, 1.3)
    assert log["y_t"].values[-1, 2] - log["y_t"].values[0, 2] < -0.02


@pytest.mark.slow
def test_what_leads_needs_a_tool_that_yields():
    settings = shipped_scenario("pfc_comau_6r")
    settings.teleoperation = TeleoperationParameters()
    with pytest.raises(InputError, match="teleoperation = given"):
        build_station(settings, SCENARIOS)


def test_somebody_holds_the_leader():
    settings = region()
    settings.hand = None
    with pytest.raises(InputError, match="hand = null"):
        build_station(settings, SCENARIOS)


def test_tanks_hold_what_forces_take_in_a_tick():
    settings = region()
    settings.teleoperation.tank.initial = 0.05
    with pytest.raises(InputError, match=r"teleoperation.tank.initial = 0.05"):
        build_station(settings, SCENARIOS)


@pytest.mark.slow
def test_a_hand_may_be_a_little_beyond_the_ends_of_a_path():
    settings = shipped_scenario("teleop_path")
    settings.hand = HandParameters([HandWaypoint(0.0, [-0.4, 0, 0])], frame="manifold")
    build_station(settings, SCENARIOS)
    settings.hand = HandParameters([HandWaypoint(0.0, [-0.6, 0, 0])], frame="manifold")
    with pytest.raises(InputError, match=r"hand.waypoints\[0\].position = \[-0.6"):
        build_station(settings, SCENARIOS)


@pytest.mark.parametrize(
    ("wrong", "key"),
    [
        ({"follower_force": 0.0}, "follower_force"),
        ({"clutch": [ClutchParameters(1.0, 3.0), ClutchParameters(2.0, 4.0)]}, "clutch"),
        ({"coupling": "wave"}, "waves"),
    ],
)
def test_wrong_teleoperations_are_refused(wrong, key):
    with pytest.raises(InputError, match=key):
        TeleoperationParameters(**wrong)


def test_a_robot_in_another_process_is_commanded_over_a_bus():
    settings = shipped_scenario("teleop_region")
    with pytest.raises(InputError, match=r"teleoperation.lcm = ''"):
        driven(settings)
    settings.teleoperation.lcm = "memq://"
    left, said = driven(settings)
    assert left.hand is None
    assert said[0] == "left to the leader: hand"
