"""Messages of waypoints, against those of a sender."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.streams.messages import WaypointLayout, WaypointSender
from pfsc_drake.errors import InputError
from pfsc_drake.physics.waypoint_source import Arrivals, WaypointSource


def test_it_tells_what_a_sender_tells():
    random, layout = np.random.default_rng(1), WaypointLayout(3, 4)
    ticks = np.sort(random.integers(0, 40, 11))
    rows = np.hstack([random.standard_normal((11, 3)), (np.arange(11) == 6)[:, None]])
    stepper = Stepper(WaypointSource(Arrivals(ticks, rows, 45), layout))
    sender = WaypointSender(layout)
    for k in range(60):
        for row in rows[ticks == k]:
            sender.add(row[:3], new_path=bool(row[3]))
        if k == 45:
            sender.end()
        np.testing.assert_array_equal(stepper.step()["waypoints"], sender.message)


def test_a_sender_waits_for_who_hears():
    layout = WaypointLayout(3, 4)
    sender = WaypointSender(layout)
    for k in range(10):
        sender.add([k, 0.0, 0.0])
    sender.end()
    assert sender.message[0] == 10
    sender.taken = 3
    assert sender.message[:2].tolist() == [7.0, 0.0]
    assert sender.message[2::4].tolist() == [3.0, 4.0, 5.0, 6.0]
    sender.taken = 6
    assert sender.message[:2].tolist() == [10.0, 1.0]


@pytest.mark.parametrize("ticks", [[3, 2], [1]])
def test_nonsense_is_refused(ticks):
    with pytest.raises(InputError, match=r"rows|ticks"):
        WaypointSource(Arrivals(np.array(ticks), np.zeros((2, 4)), 9), WaypointLayout(3))
