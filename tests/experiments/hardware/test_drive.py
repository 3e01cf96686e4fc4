"""A controller and a robot that know each other by messages alone, in lockstep in one process."""

import numpy as np
import pytest
from pydrake.lcm import DrakeLcm

from diagrams.builder import build_station
from diagrams.robot_station import build_robot_station
from diagrams.scenario.schema import driven
from experiments.hardware.drive import Drive
from experiments.hardware.simulated_robot import SimulatedRobot, Transport
from experiments.results.run_signals import collect_log
from experiments.scenario_file import find_scenario
from pfsc_drake.drivers.driver_rules import DriverOptions
from pfsc_drake.drivers.link import ControllerEndpoint, RobotEndpoint
from pfsc_drake.drivers.messages import ControlMode, RobotCommand, RobotMode, RobotStatus, dialect
from pfsc_drake.errors import InputError
from tests.scenarios import shipped_scenario

FOLDER = find_scenario("pfc_panda_7r").parent


_STATIONS = {}


def station_of(settings, build, **keys):
    """Return a station, built once per content; what moves is in contexts of its own."""
    key = build.__name__, repr(settings)
    if key not in _STATIONS:
        _STATIONS[key] = build(settings, FOLDER, **keys)
    return _STATIONS[key]


class Loop:
    """Both ends on one bus: a status, its answer, a tick of the robot."""

    def __init__(self, settings, kind="panda", options=None, **transport):
        settings.simulation.integrator, settings.simulation.max_step = "runge_kutta3", 1e-3
        lcm, spoken = DrakeLcm("memq://"), dialect(kind)
        self.robot_end, self.end = RobotEndpoint(lcm, spoken), ControllerEndpoint(lcm, spoken)
        self.robot = SimulatedRobot(
            station_of(settings, build_robot_station),
            settings,
            self.robot_end,
            options or DriverOptions(low_pass=0.0),
            Transport(**transport),
        )
        self.station = station_of(driven(settings)[0], build_station, remote=True)
        self.drive = Drive(self.station, self.end)

    def begin(self):
        self.robot.tell()
        self.first = self.drive.begin(self.end.receive(0.0))
        return self

    def run(self, duration, change=lambda status: status, hold=0.0):
        """Drive until a time, an end, or a robot's silence for as long as a driver waits."""
        silent = 0
        while self.drive.time < duration and not self.drive.has_ended:
            self.robot.tell()
            status = self.end.receive(0.0)
            silent = 0 if status is not None else silent + 1
            if status is not None:
                self.drive.answer(change(status))
            if silent > 100:
                self.drive.lose("no status of the robot for 100 ms")
            self.robot.advance()
        for _ in range(round(hold / self.robot.period)):
            self.robot.advance()
        return self

    @property
    def fault(self):
        return self.drive.result(1.0).fault

    def log(self):
        log = collect_log(self.station, self.drive.root)
        self.drive.add_to(log)
        return log

    def speed(self):
        return np.abs(self.robot.status().v).max()


def panda(**start):
    settings = shipped_scenario("pfc_panda_7r")
    settings.start.transition, settings.reference.dwell = 0.15, 0.15
    for name, value in start.items():
        setattr(settings.start, name, value)
    return settings


@pytest.fixture(scope="module")
def driven_panda():
    """0.7 s on the path."""
    return Loop(panda()).begin().run(1.0)


def test_an_exact_model_stays_on_the_path_over_messages(driven_panda):
    log = driven_panda.log()
    settled = log.time > 0.3
    assert driven_panda.fault is None
    assert np.abs(log["xi"].values[settled]).max() < 2e-5
    assert np.abs(log["eta_dot"].values).max() > 0.35
    assert not log["missed"].values.any()
    assert not log["clipped"].values.any()
    assert np.all(log["robot_mode"].values == RobotMode.MOVE)


def test_what_is_sent_is_what_the_law_wants_without_the_weight(driven_panda):
    """The first command holds the robot: its drives bear the weight themselves."""
    assert np.abs(driven_panda.first).max() < 1.0
    log = driven_panda.log()
    weight = log["tau_d"].values - log["sent"].values
    plant, state = driven_panda.station.part.model, driven_panda.station.part.coordinates
    context = plant.CreateDefaultContext()
    for k in (0, 450, 900):
        x = np.concatenate([log["q_J"].values[k], 0.0 * log["q_J"].values[k]])
        plant.SetPositionsAndVelocities(context, state.plant_state(np.tile(x, 2)))
        expected = -plant.CalcGravityGeneralizedForces(context)
        np.testing.assert_allclose(weight[k], expected, atol=1e-9)


@pytest.mark.slow
def test_both_sides_repeat_to_the_last_bit():
    joints = [Loop(panda()).begin().run(0.4).robot.status().q for _ in range(2)]
    np.testing.assert_array_equal(*joints)


@pytest.mark.slow
def test_a_robot_with_servos():
    settings = shipped_scenario("pfc_panda_7r")
    settings.controller.law, settings.controller.gains = "velocity_servo", {}
    settings.start.transition, settings.reference.dwell = 0.3, 0.3
    settings.controller.gains = shipped_scenario("pfc_scara_4r").controller.gains
    loop = Loop(settings).begin().run(1.0)
    assert loop.drive.mode is ControlMode.VELOCITY
    assert loop.fault is None
    assert np.abs(loop.log()["xi"].values[700:]).max() < 3e-3


@pytest.mark.slow
def test_an_iiwas_messages_do_as_well():
    log = Loop(panda(), "iiwa").begin().run(0.6).log()
    assert np.abs(log["xi"].values[log.time > 0.4]).max() < 2e-5


def test_what_was_lost_lies_between_both_statuses(monkeypatch):
    """Torques on a straight line; positions are those of ``test_bridge``."""
    loop, told = Loop(panda()).begin().run(0.02), []
    drive, tell = loop.drive, loop.drive._set_inputs
    monkeypatch.setattr(drive, "_set_inputs", lambda *given: (told.append(given), tell(*given)))
    torque = drive.inputs._torque
    for _ in range(2):
        loop.robot.advance()
    loop.robot.tell()
    drive.answer(changed(torque=torque + 3.0)(loop.end.receive(0.0)))
    torques = np.array([given[1] for given in told])
    np.testing.assert_allclose(torques - torque, np.outer([1.0, 2.0, 3.0], np.ones(7)), rtol=1e-9)
    assert [tick.missed for tick in drive.ticks[-3:]] == [1, 1, 2]


@pytest.mark.slow
def test_lost_packets_are_bridged():
    loop = Loop(panda(), lose=0.03).begin().run(0.9)
    log = loop.log()
    assert loop.fault is None
    assert 10 < log["missed"].values.sum() < 100
    assert np.abs(log["xi"].values[log.time > 0.4]).max() < 2e-4


def test_a_robot_that_falls_silent_is_left_alone():
    loop = Loop(panda()).begin().run(0.25)
    loop.robot._transport = Transport(lose=1.0)
    loop.run(2.0)
    assert loop.fault == "no status of the robot for 100 ms"
    assert len(loop.log().time) == 250


@pytest.mark.slow
@pytest.mark.parametrize(("gap", "degrees"), [(30, 5.0), (90, 8.0), (100, 8.0)])
def test_a_longer_silence_stops_the_robot(gap, degrees):
    """The robot goes on with its last torque for as long; what it moves then is in the bound."""
    settings = panda(transition=0.3)
    settings.reference.dwell = 0.3
    loop = Loop(settings, options=DriverOptions()).begin().run(0.9)
    q = loop.robot.status().q
    for _ in range(gap):
        loop.robot.advance()
    loop.run(3.0, hold=0.3)
    assert loop.fault == f"no status of the robot for {gap} ms"
    assert loop.speed() < 0.001
    assert np.rad2deg(np.abs(loop.robot.status().q - q)).max() < degrees


@pytest.mark.slow
def test_without_a_controller_the_robot_comes_to_rest():
    """The driver damps it when commands have expired."""
    loop = Loop(panda()).begin().run(0.6)
    assert loop.speed() > 0.1
    q = loop.robot.status().q
    for _ in range(1500):
        loop.robot.advance()
    assert loop.speed() < 0.05
    assert np.rad2deg(np.abs(loop.robot.status().q - q)).max() < 11.0


@pytest.mark.slow
def test_whoever_asks_for_a_stop_gets_one():
    loop = Loop(panda()).begin().run(0.6)
    q = loop.robot.status().q
    loop.drive.stop("interrupted")
    loop.run(5.0)
    assert loop.drive.has_ended
    assert loop.fault == "interrupted"
    assert loop.speed() < 0.01
    assert np.rad2deg(np.abs(loop.robot.status().q - q)).max() < 5.0
    # at rest for a while, and not for as long as it may take
    assert loop.drive.time < 2.0


def changed(**values):
    """Return what changes a status."""

    def change(status):
        return RobotStatus(
            **{name: getattr(status, name) for name in RobotStatus.__dataclass_fields__} | values
        )

    return change


def test_a_reflex_ends_it():
    loop = Loop(panda()).begin().run(0.25).run(1.0, changed(robot_mode=RobotMode.REFLEX))
    assert loop.fault == "the robot went into mode REFLEX"
    assert loop.drive.time == pytest.approx(0.251)


@pytest.mark.slow
def test_what_is_measured_is_watched():
    loop = Loop(panda()).begin().run(0.25)
    q = loop.robot.status().q
    loop.run(3.0, changed(q=np.where(np.arange(7) == 2, np.nan, q)))
    assert "a measured value is not a finite number: q_J_3" in loop.fault
    loop = Loop(panda()).begin().run(0.4)
    before = loop.robot.status().q
    jump = 0.05 * (np.arange(7) == 3)

    def shift(status):
        return changed(q=status.q + jump)(status)

    loop.run(3.0, shift)
    assert loop.fault.startswith("joint 4 jumped by 2.8")
    assert loop.drive.time < 2.0  # at rest for a while, and not for as long as it may take
    assert loop.speed() < 0.05
    assert np.rad2deg(np.abs(loop.robot.status().q - before)).max() < 5.0


def test_a_clock_that_is_set_ends_it():
    """A second is not made up for tick by tick."""
    loop = Loop(panda()).begin().run(0.2)
    shift = 1_001_000
    loop.run(1.0, lambda status: changed(utime=status.utime + shift)(status))
    assert loop.fault == "the robot's clock jumped by 1 s"
    assert len(loop.log().time) == 200


def test_what_is_no_number_is_not_sent(monkeypatch):
    loop = Loop(panda()).begin().run(0.1)
    loop.robot_end.receive_command()
    monkeypatch.setattr(loop.drive, "_command", lambda: np.full(7, np.nan))
    loop.robot.tell()
    loop.drive.answer(loop.end.receive(0.0))
    assert loop.robot_end.receive_command() is None
    assert loop.drive.has_ended
    assert loop.fault == "the controller's command is not finite"
    assert len(loop.log().time) == 100


def test_a_command_of_another_kind_ends_the_robots_driver():
    loop = Loop(panda()).begin().run(0.3)
    loop.end.send(RobotCommand(loop.robot.utime, ControlMode.VELOCITY, np.zeros(7)))
    loop.robot.advance()
    assert "for VELOCITY" in loop.robot.rules.ended
    loop.run(1.0)
    assert loop.fault == "the robot went into mode REFLEX"


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"robot_mode": RobotMode.IDLE}, "the robot is in mode IDLE; it must be in MOVE"),
        ({"control_mode": ControlMode.POSITION}, "driver is in POSITION mode; the law needs TORQU"),
        ({"q": np.zeros(6)}, "the robot has 6 joints; the scenario's has 7"),
        ({"v": np.array([0.0, 0.1, 0, 0, 0, 0, 0])}, "the robot moves: joint 2 at 0.1 rad/s"),
        ({"q": np.full(7, np.nan)}, "the robot's positions are not finite"),
        ({"q": np.zeros(7)}, "joint 4 is at 0.00 deg, .* from the scenario's start"),
    ],
)
def test_what_is_refused_before_anything_moves(values, said):
    loop = Loop(panda())
    loop.robot.tell()
    with pytest.raises(InputError, match=said):
        loop.drive.begin(changed(**values)(loop.end.receive(0.0)))
    assert loop.robot_end.receive_command() is None


def test_torques_come_up_smoothly_and_within_limits():
    """What is far from what was sent is approached at the rate that a driver bears."""
    loop = Loop(panda(transition=0.001)).begin().run(0.05)
    sent = loop.log()["sent"].values
    assert loop.log()["clipped"].values.any()
    assert np.abs(np.diff(sent, axis=0)).max() < 1.0 + 1e-9
    # whatever was sent before, a joint is told no more than its share
    share, loop.drive._sent = 0.95 * np.array([87.0] * 4 + [12.0] * 3), None
    turns = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 0.0])
    values, clipped = loop.drive._within_limits(1e3 * turns)
    np.testing.assert_allclose(values, share * turns)
    assert clipped == 6


def test_the_robots_drives_have_limits_of_their_own():
    """The weight on top of what is told among them."""
    loop = Loop(panda(), options=DriverOptions(low_pass=0.0, torque_rate=1e9))
    for sign in (1.0, -1.0):
        loop.end.send(RobotCommand(loop.robot.utime, ControlMode.TORQUE, np.full(7, sign * 1e3)))
        loop.robot.advance()
        np.testing.assert_array_equal(
            loop.robot.status().torque, sign * np.array([87.0] * 4 + [12.0] * 3)
        )


@pytest.mark.slow
def test_forces_are_measured_by_the_robot_and_told():
    """60 N deflect by 30 mm, with friction, encoders and a believed tool of another mass."""
    settings = shipped_scenario("pfc_compliant_6r")
    settings.forces[0].begin, settings.forces[0].end = 1.0, 2.0
    loop = Loop(settings).begin().run(1.9)
    log = loop.log()
    assert loop.fault is None
    pressed = np.linalg.norm(log["xi"].values[-100:], axis=1)
    assert 0.02 < pressed.min() < pressed.max() < 0.035
    assert np.linalg.norm(log["wrench_measured"].values[-1, :3]) > 45.0


def elastic(**controller):
    """Six elastic joints whose motors and torques are measured."""
    settings = shipped_scenario("pfc_elastic_6r")
    settings.reference.velocity, settings.start.transition = 0.5, 0.3
    settings.encoders.sides, settings.controller.state = "motor_and_torque", "from_torque"
    for name, value in controller.items():
        setattr(settings.controller, name, value)
    return settings


def test_a_law_for_elastic_joints_needs_both_sides_of_them():
    with pytest.raises(InputError, match=r"controller.state = measured; allowed: from_torque or"):
        driven(elastic(state="measured"))


@pytest.mark.slow
@pytest.mark.parametrize("ticks", [1, 2])
def test_elastic_joints_whose_torques_act_late(ticks):
    """The law knows of the delay, a tick of which is the link's; the other is the driver's."""
    settings = elastic(delay=ticks * 1e-3 if ticks > 1 else None)
    settings.driver.delay = ticks * 1e-3
    loop = Loop(settings, delay=1).begin().run(1.2)
    log = loop.log()
    assert loop.fault is None
    settled = log.time > 0.8
    assert np.abs(log["xi"].values[settled]).max() < 1e-4
    assert np.abs(log["eta_dot"].values[settled]).max() > 0.4
    # the links' side as it was found, not the motors' again
    bent = np.abs(log["q_M"].values - log["q_J"].values).max()
    assert bent > 3e-4


@pytest.mark.slow
def test_a_delay_that_the_law_does_not_know_is_a_fault_that_ends_at_rest():
    settings = elastic()
    settings.driver.delay = 3e-3
    loop = Loop(settings, delay=1).begin().run(2.0)
    assert loop.fault is not None
    assert loop.speed() < 0.05
