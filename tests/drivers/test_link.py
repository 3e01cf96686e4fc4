"""Both ends of a link on one bus: the newest message counts, once."""

import numpy as np
import pytest
from pydrake.lcm import DrakeLcm

from pfsc_drake.drivers.link import ControllerEnd, RobotEnd
from pfsc_drake.drivers.messages import ControlMode, RobotCommand, RobotStatus, dialect

WRENCH = np.array([1.0, -2.0, 3.0, 0.1, -0.2, 0.3])


@pytest.fixture(name="ends", params=["panda", "iiwa"])
def fixture_ends(request):
    """The robot's end and the controller's."""
    lcm, spoken = DrakeLcm("memq://"), dialect(request.param)
    return RobotEnd(lcm, spoken), ControllerEnd(lcm, spoken)


def status(utime):
    return RobotStatus(utime, *np.full((3, 7), 1e-3 * utime))


def command(utime):
    return RobotCommand(utime, ControlMode.TORQUE, np.full(7, 1e-3 * utime))


def test_the_newest_status_is_received_once(ends):
    robot, controller = ends
    for utime in (1000, 2000, 3000):
        robot.tell(status(utime))
    found = controller.receive(0.0)
    assert found.utime == 3000
    np.testing.assert_array_equal(found.q, np.full(7, 3.0))
    assert controller.receive(0.0) is None
    robot.tell(status(4000))
    assert controller.receive(0.0).utime == 4000


def test_the_newest_command_is_heard_once(ends):
    robot, controller = ends
    assert robot.hear() is None
    for utime in (1000, 2000):
        controller.send(command(utime))
    found = robot.hear()
    assert (found.utime, found.mode) == (2000, ControlMode.TORQUE)
    np.testing.assert_array_equal(found.values, np.full(7, 2.0))
    assert robot.hear() is None


def test_a_wrench_comes_with_its_status_and_stays(ends):
    robot, controller = ends
    robot.tell(status(1000), WRENCH)
    assert controller.receive(0.0).utime == 1000
    np.testing.assert_array_equal(controller.wrench, WRENCH)
    robot.tell(status(2000))
    controller.receive(0.0)
    np.testing.assert_array_equal(controller.wrench, WRENCH)


def test_what_cannot_be_read_is_as_good_as_lost(ends):
    robot, controller = ends
    for channel in (robot.dialect.status_channel, robot.dialect.command_channel, "FORCE_TORQUE"):
        robot.lcm.Publish(channel, b"nothing of the kind")
    assert controller.receive(0.0) is None
    assert robot.hear() is None
    assert controller.wrench is None
    robot.tell(status(1000))
    controller.send(command(1000))
    assert controller.receive(0.0).utime == robot.hear().utime == 1000
