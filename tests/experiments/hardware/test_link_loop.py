"""What goes on between the ticks of a link: gaps, old messages, ends, halts."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from experiments.hardware import simulated_robot
from experiments.hardware.check import check_alone, check_first
from experiments.hardware.driven_run import run_drive
from experiments.hardware.simulated_robot import run_robot
from pfsc_drake.drivers.messages import ControlMode, RobotCommand, RobotMode, RobotStatus
from pfsc_drake.errors import InputError
from tests.experiments.hardware.test_drive import Loop, changed, panda

STATUS = RobotStatus(0, np.array([0.1, -0.2]), np.zeros(2), np.zeros(2))


def test_what_was_missed_is_taken_to_lie_between():
    """Three ticks without a status: the controller sees a cubic way, and answers the last."""
    loop, told = Loop(panda()), []
    drive, status, tell = loop.drive, loop.robot.status(), loop.drive._set_inputs

    def at(tick, **values):
        return changed(utime=5_000_000 + 1000 * tick, **values)(status)

    def note(state, torque):
        told.append(np.concatenate([state, torque]))
        tell(state, torque)

    drive._set_inputs = note
    drive.begin(at(0))
    for tick in range(3):
        drive.answer(at(tick))
    loop.robot_end.receive_command()
    before, later = (
        told[-1],
        at(6, q=status.q + 4e-4, v=status.v + 0.02, torque=status.torque + 2.0),
    )
    told.clear()
    drive.answer(later)
    after = np.concatenate([later.q, later.v, later.q, later.v, later.torque])
    ticks = np.arange(1.0, 5.0) * 1e-3
    way = CubicHermiteSpline([0.0, 4e-3], [before[:7], after[:7]], [before[7:14], after[7:14]])
    side = np.hstack([way(ticks), way(ticks, 1)])
    torque = before[28:] + ticks[:, None] / 4e-3 * (after[28:] - before[28:])
    np.testing.assert_allclose(told, np.hstack([side, side, torque]), rtol=0, atol=1e-12)
    assert loop.robot_end.receive_command().utime == later.utime
    assert drive.time == pytest.approx(0.007)
    # what comes after the next is nothing any more
    drive.answer(at(5))
    assert loop.robot_end.receive_command() is None
    assert drive.time == pytest.approx(0.007)
    # a robot that trembles does not rest, and is left alone in the end
    drive.stop("enough")
    for speed, resting in ((0.02, 0), (0.0, 1), (0.0, 2), (-0.02, 0)):
        drive._look(status, np.repeat([0.0, speed, 0.0, speed], 7))
        assert drive._resting == resting
    for since, ended in ((1.9, False), (2.1, True)):
        drive._stop_time = drive.time - since
        assert drive.has_ended == ended


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize("off", [-0.03, 0.03])
def test_a_robot_stands_at_its_start_on_neither_side_of_it(joint, off):
    start = STATUS.q - off * (np.arange(2) == joint)
    with pytest.raises(InputError, match=rf"joint {joint + 1} is at .* from the scenario's start"):
        check_first(STATUS, ControlMode.TORQUE, start)
    near = STATUS.q - 0.5 * off * (np.arange(2) == joint)
    # a driver that tells no mode may be in the one that is needed
    for mode in (ControlMode.NONE, ControlMode.TORQUE):
        told = RobotStatus(0, STATUS.q, STATUS.v, STATUS.torque, RobotMode.MOVE, mode)
        check_first(told, ControlMode.TORQUE, near)


class Counted:
    """A drive that counts what it is told."""

    period, has_ended, override = 1e-3, False, 1.0

    def __init__(self):
        self.begun, self.answered, self.lost = [], [], None

    @property
    def time(self):
        return len(self.answered) * self.period

    @property
    def motion_time(self):
        return self.time

    def progress(self):
        return {}

    def begin(self, status):
        self.begun.append(status)

    def answer(self, status):
        self.answered.append(status)

    def lose(self, why):
        self.lost = why

    def result(self, wall):
        return self.lost


@pytest.mark.parametrize(
    ("count", "answers", "lost"), [(40, 11, None), (6, 5, "no status of the robot for 100 ms")]
)
def test_a_drive_begins_with_what_is_new_and_ends_in_time(count, answers, lost):
    """The first status came while nobody listened."""
    waiting, drive = list(range(count)), Counted()
    end = SimpleNamespace(
        receive=lambda timeout: waiting.pop(0) if waiting else None,
        requests=list,
        publish_progress=lambda utime, values: None,
        foreign=0,
    )
    found = run_drive(drive, end, 0.01, lambda: False, lambda *_: None)
    assert drive.begun == [1]
    assert drive.answered == list(range(1, answers + 1))
    assert found == lost


def test_a_second_sender_ends_the_drive():
    loop, heard = Loop(panda()), []
    other = RobotCommand(0, ControlMode.TORQUE, 3.0 * np.eye(7)[6])
    receive, send = loop.end.receive, loop.end.send

    def answer(command):
        send(command)
        if len(heard) == 30:
            for _ in range(2):
                loop.end.lcm.Publish(loop.end.dialect.command_channel, spoken(other))
        heard.append(command)
        loop.robot.advance()

    def tell_and_receive(timeout):
        loop.robot.tell()
        return receive(timeout)

    spoken = loop.end.dialect.encode_command
    loop.end.receive, loop.end.send = tell_and_receive, answer
    result = run_drive(loop.drive, loop.end, 1.0, lambda: False, lambda *_: None)
    assert result.fault == "another sender commands the robot"
    assert loop.end.foreign == 2
    assert 200 < len(heard) < 400  # it rests at its start
    loop.end.lcm.Publish(loop.end.dialect.command_channel, spoken(other))
    check_alone(loop.end)  # of one that has ended before
    loop.end.receive = lambda timeout: (
        loop.end.lcm.Publish(loop.end.dialect.command_channel, spoken(other)) or receive(0.01)
    )
    with pytest.raises(InputError, match=r"another sender .*: [0-9]+ commands on"):
        check_alone(loop.end)


def test_after_a_long_halt_time_is_not_caught_up(monkeypatch):
    """A robot that made up for 0.3 s at once would move without a controller."""
    clock, begun = [0.0], []

    def sleep(time):
        clock[0] += time

    def advance():
        robot.tick += 1
        clock[0] += 0.3 if robot.tick == 10 else 1e-4

    monkeypatch.setattr(
        simulated_robot, "time", SimpleNamespace(monotonic=lambda: clock[0], sleep=sleep)
    )
    robot = SimpleNamespace(
        period=1e-3, tick=0, tell=lambda: begun.append(clock[0]), advance=advance
    )
    share = run_robot(robot, lambda: False, lambda _: None, 0.03)
    steps = np.diff(begun)
    assert len(begun) == 30
    np.testing.assert_allclose(steps[:9], 1e-3)
    assert steps[9] == pytest.approx(0.3)
    np.testing.assert_allclose(steps[10:], 1e-3)
    assert share == pytest.approx(29.0 / 30.0)
