"""A simulated robot with one thing wrong moves slowly, and it is said what is wrong."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.lcm import DrakeLcm

from diagrams.robot_station import build_robot_station
from diagrams.robots.arm_model import read_arm
from experiments.hardware import slow_motion
from experiments.hardware.simulated_robot import SimulatedRobot, Transport
from experiments.hardware.slow_motion import JointTour, move_slowly
from experiments.hardware.statics import check_statics
from experiments.scenario_file import find_scenario
from pfsc_drake.controller.options.friction_parameters import JointFrictionParameters
from pfsc_drake.drivers.driver_rules import DriverOptions
from pfsc_drake.drivers.link import ControllerEndpoint, RobotEndpoint
from pfsc_drake.drivers.messages import ControlMode, RobotMode, RobotStatus, dialect
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import gravity_function, mass_function
from tests.experiments.hardware.test_drive import panda

FOLDER = find_scenario("pfc_panda_7r").parent
PERIOD = 4e-3  # s, of what leads the simulated robot


class Stepped(ControllerEndpoint):
    """The controller's end, on which waiting is a tick of the robot."""

    def __init__(self, robot_settings, seen, heard):
        lcm, spoken = DrakeLcm("memq://"), dialect("panda")
        super().__init__(lcm, spoken)
        robot_settings.simulation.integrator = "runge_kutta3"
        robot_settings.simulation.max_step = PERIOD / 2.0
        self.robot = SimulatedRobot(
            build_robot_station(robot_settings, FOLDER),
            robot_settings,
            RobotEndpoint(lcm, spoken),
            DriverOptions(),
            Transport(),
        )
        self._seen, self._heard = seen, heard
        self.robot.advance()
        self.robot.tell()

    def receive(self, timeout):
        status = super().receive(0.0)
        if status is None:
            self.robot.advance()
            self.robot.tell()
            status = super().receive(0.0)
        return None if status is None else self._seen(status)

    def send(self, command):
        super().send(replace(command, values=self._heard(command.values)))
        self.robot.advance()
        self.robot.tell()


def checked(seen=lambda status: status, heard=lambda values: values, settings=None, load=0.0):
    """Return what the check says of a robot whose messages are changed on their way.

    What the robot carries, its driver does not compensate.
    """
    settings = settings or panda()
    settings.controller.sampling_time = PERIOD
    true = read_arm(settings.robot, FOLDER).chain
    end = Stepped(settings, seen, heard)
    if load:
        end.robot._weight = gravity_function(carrying(true, -load))
    first = end.receive(0.0)
    believed = carrying(true, -load)
    tour = JointTour(believed, first.q, 3.0, ControlMode.TORQUE, PERIOD)
    q, torque, complaint = move_slowly(end, tour, lambda: False, lambda t, phase: None)
    if not len(q):
        q, torque = first.q[None], first.torque[None]
    found = replace(check_statics(believed, q, torque), complaint=complaint)
    return found, np.abs(end.robot.status().q - first.q).max()


def carrying(chain, mass):
    """Return a robot with so much more mass in its tool point."""
    last = chain.links[-1]
    total = last.mass + mass
    p_LC = (last.mass * last.p_LC + mass * chain.p_LT) / total
    return replace(chain, links=(*chain.links[:-1], replace(last, mass=total, p_LC=p_LC)))


@pytest.fixture(autouse=True)
def quicker(monkeypatch):
    monkeypatch.setattr(slow_motion, "_OF_A_JOINT", 2.5)
    monkeypatch.setattr(slow_motion, "_SETTLING", 0.5)


class Obedient:
    """A robot that does exactly what it is to do, with friction and inertia, and tells it.

    Args:
        chain: The robot.
        seen: Changes what it tells.
    """

    foreign = 0

    def __init__(self, chain, seen=lambda status: status):
        self.chain, self._tick, self._seen = chain, 0, seen
        start = np.deg2rad([20.0, -30.0, 25.0, -110.0, 15.0, 80.0, 40.0])
        self._tour = JointTour(chain, start, 3.0, ControlMode.TORQUE, 0.01)
        self.weight, self._mass = gravity_function(chain), mass_function(chain)

    def receive(self, timeout):
        q, v, a = self._tour.desired(0.01 * self._tick)
        torque = np.asarray(self.weight(q)).ravel() + np.asarray(self._mass(q)) @ a
        torque += 3.0 * np.sign(v) * (np.abs(v) > 1e-9) + 2.0 * v
        self._tick += 1
        return self._seen(RobotStatus(10_000 * (self._tick - 1), q, v, torque))

    def send(self, command):
        """Need no command."""

    def checked(self, believed):
        """Return what it told in slow motion, and what the check says of it."""
        first = self.receive(0.0)
        tour = JointTour(believed, first.q, 3.0, ControlMode.TORQUE, 0.01)
        q, torque, complaint = move_slowly(self, tour, lambda: False, lambda t, phase: 0)
        assert complaint is None
        return (q, torque), check_statics(believed, q, torque)


@pytest.fixture(scope="module", name="chain")
def fixture_chain():
    return read_arm(panda().robot, FOLDER).chain


@pytest.mark.slow
def test_friction_and_inertia_take_no_part(chain):
    robot = Obedient(chain)
    (q, torque), found = robot.checked(chain)
    assert np.all(np.isfinite(torque).sum(axis=0) >= 5)
    assert found.is_good
    off = torque - np.array([np.asarray(robot.weight(posture)).ravel() for posture in q])
    assert np.nanmax(np.abs(off)) < 0.1


def flip(values, joint):
    return np.where(np.arange(7) == joint, -values, values)


@pytest.mark.slow(but="2.0")
@pytest.mark.parametrize("degrees", [2.0, -3.0])
def test_a_zero_that_is_off(chain, degrees):
    off = np.deg2rad(degrees) * (np.arange(7) == 1)
    _, found = Obedient(chain, lambda s: replace(s, q=s.q + off)).checked(chain)
    # alone, while at rest as well other zeros may be
    assert found.verdict.startswith(f"most likely the zero of joint 2 is off by {degrees}")
    assert "also possible" not in found.verdict


def test_a_torque_with_the_wrong_sign(chain):
    robot = Obedient(chain, lambda s: replace(s, torque=flip(s.torque, 3)))
    verdict = robot.checked(chain)[1].verdict
    assert verdict.startswith("most likely the torque of joint 4 has the wrong sign")


@pytest.mark.slow
def test_gravity_from_another_side(chain):
    upside_down = replace(chain, gravity=np.array([0.0, 0.0, 9.81]))
    _, found = Obedient(chain).checked(upside_down)
    assert found.verdict.startswith("most likely gravity is [")
    numbers = found.causes[0].words.split("[")[1].split("]")[0]
    np.testing.assert_allclose(np.array(numbers.split(","), float), [0.0, 0.0, -9.81], atol=0.1)


@pytest.mark.slow
def test_a_robot_as_it_is_believed_with_friction():
    settings = panda()
    settings.friction = JointFrictionParameters(f_c=[2.0] * 4 + [0.5] * 3, f_v=[1.0] * 7)
    found, off = checked(settings=settings)
    assert found.verdict == "the robot's torques at rest and along the motion agree with the model"
    assert found.is_good
    # every joint has moved, and come back
    assert np.all(np.ptp(found.q, axis=0) > np.deg2rad(2.5))
    assert off < np.deg2rad(0.5)


@pytest.mark.slow
def test_a_payload_that_nobody_told():
    found, off = checked(load=0.5)
    assert found.verdict.startswith("most likely the tool weighs 0.5")
    assert "kg more than in the model" in found.verdict
    assert off < np.deg2rad(1.0)


def test_a_joint_that_turns_the_other_way_than_it_is_told():
    found, off = checked(heard=lambda values: flip(values, 1))
    assert found.complaint.startswith("joint 2 is ")
    assert "in the opposite direction" in found.verdict
    assert off < np.deg2rad(8.0)


def test_a_velocity_with_the_wrong_sign():
    found, _ = checked(seen=lambda s: replace(s, v=flip(s.v, 5)))
    assert found.complaint.startswith("joint 6 ")


def test_a_robot_that_leaves_its_mode_or_tells_nonsense():
    found, _ = checked(seen=lambda s: replace(s, robot_mode=RobotMode.REFLEX))
    assert found.complaint == "the robot went into mode REFLEX"
    found, _ = checked(seen=lambda s: replace(s, v=s.v * np.nan))
    assert found.complaint == "the robot's positions or velocities are not finite"


@pytest.mark.parametrize("degrees", [0.0, 30.0, np.nan])
def test_angles_out_of_range(degrees):
    with pytest.raises(InputError, match="--move = "):
        JointTour(None, None, degrees, ControlMode.TORQUE, 1e-3)
