"""Both ends of a teleoperation on one bus: the newest message counts, and no device jumps."""

import numpy as np
import pytest
from pydrake.lcm import DrakeLcm

from pfsc_drake.control.teleoperation.message import FIELDS, MESSAGE
from pfsc_drake.drivers.remote_values import encode_values
from pfsc_drake.drivers.teleoperation_link import TeleoperationEndpoint, channel_of


def message(count, signal=0.0, energy=0.0):
    sums = np.zeros(MESSAGE)
    sums[FIELDS["count"]], sums[FIELDS["signal"]] = count, signal
    sums[FIELDS["felt"]], sums[FIELDS["energy"]] = np.arange(1.0, 7.0), energy
    return sums


@pytest.fixture(name="ends")
def fixture_ends():
    lcm = DrakeLcm("memq://")
    return TeleoperationEndpoint(lcm, "leader"), TeleoperationEndpoint(lcm, "follower")


def test_nothing_is_zero(ends):
    np.testing.assert_array_equal(ends[1].newest(), np.zeros(MESSAGE))


def test_the_newest_is_heard_by_the_other_side_alone(ends):
    leader, follower = ends
    for count in (1, 2, 3):
        leader.send(message(count, count - 1.0, 0.1 * (count - 1)))
    np.testing.assert_allclose(follower.newest(), message(3, 2.0, 0.2))
    assert follower.received == 3
    assert leader.received == 0


def test_who_comes_late_does_not_jump(ends):
    """Earlier sums count as zero, later ones in full."""
    leader, follower = ends
    leader.send(message(500, 7.0, 3.0))
    np.testing.assert_allclose(follower.newest(), message(500, 0.0, 0.0))
    leader.send(message(501, 7.5, 3.2))
    np.testing.assert_allclose(follower.newest(), message(501, 0.5, 0.2))


def test_who_begins_anew_goes_on_from_there(ends, monkeypatch):
    leader, follower = ends
    for count in (1, 2):
        leader.send(message(count, 2.0 * (count - 1), count - 1.0))
    follower.newest()
    monkeypatch.setattr("time.time_ns", lambda: 10**19)
    leader.begin()
    leader.send(message(1, 0.0, 0.0))
    np.testing.assert_allclose(follower.newest(), message(1, 2.0, 1.0))
    leader.send(message(2, 0.25, 0.5))
    np.testing.assert_allclose(follower.newest(), message(2, 2.25, 1.5))


def test_what_is_old_wrong_or_takes_energy_back_is_lost(ends):
    leader, follower = ends
    for sums in (message(5, 0.0), message(6, 1.0, 0.4)):
        leader.send(sums)
    newest_message = follower.newest()
    leader.send(message(4, 9.0, 0.5))
    leader.send(message(7, 9.0, 0.3))
    leader.send(message(8, np.nan, 0.5))
    leader.lcm.Publish(channel_of("leader"), b"nothing of the kind")
    leader.lcm.Publish(channel_of("leader"), encode_values(1, {"count": 9.0}))
    np.testing.assert_array_equal(follower.newest(), newest_message)
    leader.send(message(9, 2.0, 0.6))
    assert follower.newest()[0] == 9.0


def test_who_was_there_and_is_silent_is_lost():
    now, lcm = [100.0], DrakeLcm("memq://")
    leader = TeleoperationEndpoint(lcm, "leader")
    follower = TeleoperationEndpoint(lcm, "follower", 0.5, lambda: now[0])
    now[0] += 10.0
    assert not follower.is_lost  # nobody has been there yet
    leader.send(message(1))
    follower.newest()
    now[0] += 0.4
    assert not follower.is_lost
    leader.send(message(1))  # an old one is no word of it
    follower.newest()
    now[0] += 0.2
    assert follower.is_lost
    leader.send(message(2))
    follower.newest()
    assert not follower.is_lost
