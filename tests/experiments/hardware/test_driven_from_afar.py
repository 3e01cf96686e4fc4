"""A robot behind a driver that is led from a third place, and whose leader falls silent."""

import math

import numpy as np
import pytest

from experiments.results.teleoperation_feature import teleoperation_metrics
from pfsc_drake.control.teleoperation.message import FIELDS, MESSAGE
from pfsc_drake.drivers.teleoperation_link import TeleoperationEndpoint
from tests.experiments.hardware.test_drive import Loop
from tests.scenarios import shipped_scenario

SPEED, BEGIN, LEADS = 0.15, 0.5, 0.6  # m/s, s, s
SILENT = 0.3  # s


class Leader:
    """Waves of a hand that would move at a speed along the begin of the path, and their energy."""

    def __init__(self, loop, impedance, along):
        self._loop, self._end = loop, TeleoperationEndpoint(loop.station.leader.lcm, "leader")
        self._wave = math.sqrt(2.0 * impedance) * SPEED * along
        self._message, self._period = np.zeros(MESSAGE), loop.drive.period

    def say(self):
        """Tell what goes with this tick."""
        self._message[FIELDS["count"]] += 1
        if self._loop.drive.time > BEGIN:
            self._message[FIELDS["signal"]][:3] += self._period * self._wave
            self._message[FIELDS["energy"]] += self._period * self._wave @ self._wave / 2.0
        self._end.send(self._message)


@pytest.fixture(name="led", scope="module")
def fixture_led():
    """A loop whose leader is silent from 1.1 s on, that has ended."""
    settings = shipped_scenario("teleop_path")
    settings.teleoperation.lcm, settings.teleoperation.silence = "memq://", SILENT
    loop = Loop(settings).begin()
    loop.station.leader._clock = lambda: loop.drive.time
    path = loop.station.path
    along = path.evaluator(1).evaluate_at(path.arc_length.parameter(0.05))
    layout = path.evaluator(1).layout
    tangent = along[layout.position][3:6]
    leader = Leader(loop, settings.teleoperation.impedance, tangent / np.linalg.norm(tangent))
    while loop.drive.time < BEGIN + LEADS:
        leader.say()
        loop.run(loop.drive.time + 0.5 * loop.drive.period)
    loop.run(4.0)
    return loop, settings


@pytest.mark.slow
def test_it_goes_where_the_leader_has_it(led):
    """A follower of the damping of the waves' impedance b goes by 2b/(b + d) of their speed."""
    loop, settings = led
    log = loop.log()
    b, d = settings.teleoperation.impedance, settings.compliance.tangential.damping.value
    steady = (log.time > BEGIN + 0.3) & (log.time < BEGIN + LEADS)
    speed = np.gradient(log["eta"].values[:, 0], log.time)
    assert speed[steady].mean() == pytest.approx(2 * b / (b + d) * SPEED, rel=0.02)
    assert np.abs(log["xi"].values).max() < 5e-4


@pytest.mark.slow
def test_it_stops_in_place_where_the_leader_is_silent(led):
    loop, _ = led
    log = loop.log()
    assert loop.fault == f"no message of the leader for {SILENT:g} s"
    eta, last = log["eta"].values[:, 0], np.searchsorted(log.time, BEGIN + LEADS)
    assert abs(eta[-1] - eta[last]) < 0.02
    assert log.time[-1] < BEGIN + LEADS + SILENT + 1.0
    assert loop.speed() < 1e-2
    # at rest long before it is said: the waves have ended
    assert np.ptp(eta[last + 200 : last + 300]) < 2e-4


@pytest.mark.slow
def test_its_tank_is_audited(led):
    loop, settings = led
    metrics = teleoperation_metrics(loop.log(), settings)
    assert metrics["least_port_tank"].value >= 0.0
    assert metrics["audit_ports"].value < 1e-12
