"""Whatever fails on the way, a robot comes to rest near where it was then."""

import numpy as np
import pytest

from experiments.hardware.simulated_robot import Transport
from pfsc_drake.drivers.driver_rules import DriverOptions
from pfsc_drake.drivers.messages import ControlMode, RobotCommand, RobotMode
from tests.experiments.hardware.test_drive import Loop, changed, elastic, panda

# of a driver that waits no longer than a controller bridges, and damps well: docs/howto/robot.md
QUICK = {"expiry": 0.02, "damping": 20.0}
BEGIN, STOPPED = 0.6, 3.0


def moving(kind):
    """Return a robot on its way, at 0.4 m/s, behind a quick driver."""
    if kind == "panda":
        return Loop(panda(), options=DriverOptions(**QUICK)).begin().run(BEGIN)
    settings = elastic()
    settings.reference.velocity, settings.driver.delay = 0.4, 1e-3
    options = DriverOptions(low_pass=0.0, **QUICK)
    return Loop(settings, options=options, delay=1).begin().run(BEGIN)


def alone(loop, ticks):
    """Let the robot move without a controller."""
    for _ in range(ticks):
        loop.robot.advance()


def killed_controller(loop):
    alone(loop, 600)


def lost_link(loop):
    loop.robot._transport = Transport(lose=1.0)
    loop.run(STOPPED)
    alone(loop, 600)


def silence(ticks):
    def fail(loop):
        alone(loop, ticks)
        loop.run(STOPPED, hold=0.3)

    return fail


def command_of_another_mode(loop):
    size = len(loop.robot.status().q)
    loop.end.send(RobotCommand(loop.robot.utime, ControlMode.VELOCITY, np.zeros(size)))
    loop.robot.advance()
    loop.run(STOPPED)
    alone(loop, 600)


def no_number(loop):
    def lose(status):
        q = np.where(np.arange(len(status.q)) == 2, np.nan, status.q)
        return changed(q=q)(status)

    loop.run(STOPPED, lose, hold=0.3)


def jump(loop):
    def shift(status):
        return changed(q=status.q + 0.05 * (np.arange(len(status.q)) == 3))(status)

    loop.run(STOPPED, shift, hold=0.3)


def reflex(loop):
    """The robot itself would brake; here it goes on until commands have expired."""
    loop.run(STOPPED, changed(robot_mode=RobotMode.REFLEX))
    alone(loop, 600)


def old_commands(loop):
    loop.robot._late.extend([None] * 25)
    loop.run(STOPPED)
    alone(loop, 600)


FAULTS = {
    "controller killed": killed_controller,
    "link lost": lost_link,
    "12 ms of silence": silence(12),
    "20 ms of silence": silence(20),
    "30 ms of silence": silence(30),
    "100 ms of silence": silence(100),
    "wrong mode": command_of_another_mode,
    "no number": no_number,
    "jump": jump,
    "reflex": reflex,
    "commands too old": old_commands,
}
OF_ELASTIC_JOINTS = ("controller killed", "100 ms of silence", "no number", "jump")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "fault"),
    [("panda", fault) for fault in FAULTS] + [("elastic", fault) for fault in OF_ELASTIC_JOINTS],
)
def test_a_fault_ends_at_rest_within_5_deg(kind, fault):
    loop = moving(kind)
    assert loop.speed() > 0.5
    begun, farthest, advance = loop.robot.status().q, [0.0], loop.robot.advance

    def watched():
        advance()
        farthest.append(np.abs(loop.robot.status().q - begun).max())

    loop.robot.advance = watched
    FAULTS[fault](loop)
    assert loop.speed() < 0.01
    assert 0.5 < np.rad2deg(max(farthest)) < 5.0


@pytest.mark.slow
@pytest.mark.parametrize("ticks", [1, 5, 10])
def test_what_is_bridged_is_no_fault(ticks):
    loop = moving("panda")
    alone(loop, ticks)
    log = loop.run(BEGIN + 0.2).log()
    assert loop.fault is None
    assert np.abs(log["xi"].values[log.time > BEGIN]).max() < 1e-4
