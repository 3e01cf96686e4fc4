"""Both ends of a link on one bus: the newest message counts, once."""

import numpy as np
import pytest
from pydrake.lcm import DrakeLcm

from pfsc_drake.drivers.link import ControllerEndpoint, RobotEndpoint
from pfsc_drake.drivers.messages import (
    FORCE_TORQUE_CHANNEL,
    ControlMode,
    RobotCommand,
    RobotStatus,
    dialect,
    encode_wrench,
)

STATUS = RobotStatus(7, *np.arange(21.0).reshape(3, 7))
COMMAND = RobotCommand(7, ControlMode.TORQUE, np.arange(7.0))
WRENCH = np.array([1.0, -2.0, 3.0, 0.1, -0.2, 0.3])


@pytest.fixture(name="ends", params=["panda", "iiwa"])
def fixture_ends(request):
    """The robot's end and the controller's."""
    lcm, spoken = DrakeLcm("memq://"), dialect(request.param)
    return RobotEndpoint(lcm, spoken), ControllerEndpoint(lcm, spoken)


def status(utime):
    return RobotStatus(utime, *np.full((3, 7), 1e-3 * utime))


def command(utime):
    return RobotCommand(utime, ControlMode.TORQUE, np.full(7, 1e-3 * utime))


def test_the_newest_status_is_received_once(ends):
    robot, controller = ends
    for utime in (1000, 2000, 3000):
        robot.send_status(status(utime))
    found = controller.receive(0.0)
    assert found.utime == 3000
    np.testing.assert_array_equal(found.q, np.full(7, 3.0))
    assert controller.receive(0.0) is None
    robot.send_status(status(4000))
    assert controller.receive(0.0).utime == 4000


def test_the_newest_command_is_heard_once(ends):
    robot, controller = ends
    assert robot.receive_command() is None
    for utime in (1000, 2000):
        controller.send(command(utime))
    found = robot.receive_command()
    assert (found.utime, found.mode) == (2000, ControlMode.TORQUE)
    np.testing.assert_array_equal(found.values, np.full(7, 2.0))
    assert robot.receive_command() is None


def test_commands_of_other_senders_are_counted(ends):
    _, controller = ends
    for utime in (1000, 2000):
        controller.send(command(utime))
    controller.receive(0.0)
    assert controller.foreign == 0
    other = controller.dialect.encode_command(command(2001))
    for _ in range(3):
        controller.lcm.Publish(controller.dialect.command_channel, other)
    controller.receive(0.0)
    assert controller.foreign == 3
    controller.lcm.Publish(controller.dialect.command_channel, b"no command at all")
    controller.receive(0.0)
    assert controller.foreign == 4


def test_a_wrench_comes_with_its_status_and_stays(ends):
    robot, controller = ends
    robot.send_status(status(1000), WRENCH)
    assert controller.receive(0.0).utime == 1000
    np.testing.assert_array_equal(controller.wrench, WRENCH)
    robot.send_status(status(2000))
    controller.receive(0.0)
    np.testing.assert_array_equal(controller.wrench, WRENCH)


def test_what_cannot_be_read_is_as_good_as_lost(ends):
    robot, controller = ends
    for channel in (robot.dialect.status_channel, robot.dialect.command_channel, "FORCE_TORQUE"):
        robot.lcm.Publish(channel, b"nothing of the kind")
    assert controller.receive(0.0) is None
    assert robot.receive_command() is None
    assert controller.wrench is None
    robot.send_status(status(1000))
    controller.send(command(1000))
    assert controller.receive(0.0).utime == robot.receive_command().utime == 1000


@pytest.mark.parametrize("kind", ["panda", "iiwa"])
@pytest.mark.parametrize("left", [0, 7, 15, 50, -1])
def test_what_is_cut_off_is_as_good_as_lost(kind, left):
    lcm, spoken = DrakeLcm("memq://"), dialect(kind)
    controller, robot = ControllerEndpoint(lcm, spoken), RobotEndpoint(lcm, spoken)
    lcm.Publish(spoken.status_channel, spoken.encode_status(STATUS)[:left])
    lcm.Publish(spoken.command_channel, spoken.encode_command(COMMAND)[:left])
    lcm.Publish(FORCE_TORQUE_CHANNEL, encode_wrench(7, np.arange(6.0))[:left])
    assert robot.receive_command() is None
    assert controller.receive(0.0) is None
    assert controller.wrench is None
    robot.send_status(STATUS, np.arange(6.0))
    controller.send(COMMAND)
    assert controller.receive(0.0).utime == robot.receive_command().utime == 7
    np.testing.assert_array_equal(controller.wrench, np.arange(6.0))


def test_who_has_left_a_bus_hears_nothing_more():
    lcm, spoken = DrakeLcm("memq://"), dialect("panda")
    controller = ControllerEndpoint(lcm, spoken)
    controller.leave()
    with pytest.raises(AttributeError, match="lcm"):
        controller.receive(0.0)
