"""A hand on a link: where it pulls, how much, and when it lets go."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.errors import InputError
from pfsc_drake.physics.link_forces import LinkHand, LinkHandParameters

START = np.array([0.4, -0.1, 0.9])
REST = np.zeros(3)
PUSH = {"link": "link_4", "way": [0.0, 0.15, 0.0], "begin": 1.0, "duration": 0.5, "hold": 0.4}


def force(time, point=START, velocity=REST, **changes):
    hand = LinkHand(LinkHandParameters(**PUSH | changes), 1e-3)
    return ca.evalf(hand.force(time, point, velocity, START)).full().ravel()


def test_spring_and_damper_towards_the_hand():
    """Finally 300 N/m times the remaining deflection of 15 cm, less 30 N s/m times speed."""
    moved = START + np.array([0.0, 0.1, 0.02])
    assert force(1.6, moved, np.array([0.1, 0.0, -0.2])) == pytest.approx(
        [-3.0, 300 * 0.05, -300 * 0.02 + 6.0]
    )
    # half way after half of the time, where it moves at 15 / 8 of its mean speed
    expected = 300 * 0.075 + 30 * 0.15 / 0.5 * 15 / 8
    assert force(1.25) == pytest.approx([0.0, expected, 0.0])


def test_the_force_is_limited():
    assert np.linalg.norm(force(1.6, START - [1.0, 2.0, 0.0])) == pytest.approx(45.0)


def test_it_takes_hold_and_lets_go_smoothly():
    assert not force(0.9).any()
    assert not force(1.0).any()
    assert force(1.9)[1] == pytest.approx(45.0)
    assert force(2.0)[1] == pytest.approx(22.5)
    assert not force(2.1).any()


def test_it_comes_back_before_it_lets_go():
    assert force(1.9, comes_back=True)[1] == pytest.approx(45.0)
    late = force(2.4, comes_back=True)
    assert np.abs(late).max() == pytest.approx(0.0, abs=1e-9)
    assert force(2.4, START - [0.0, 0.1, 0.0], comes_back=True)[1] == pytest.approx(30.0)
    assert not force(2.6, START - [0.0, 0.1, 0.0], comes_back=True).any()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"way": [0.0, 1.0]}, r"way = \[0.0, 1.0\]: must be 3"),
        ({"point": [0.0, np.nan, 0.0]}, "point = "),
        ({"begin": -1.0}, "begin = -1.0; allowed: zero or a positive number"),
        ({"duration": 0.0}, "duration = 0.0; allowed: a positive number"),
        ({"hold": np.inf}, "hold = inf"),
        ({"stiffness": 0.0}, "stiffness = 0.0"),
        ({"force_limit": -1.0}, "force_limit = -1.0"),
    ],
)
def test_wrong_properties_are_refused(changes, message):
    with pytest.raises(InputError, match=message):
        LinkHandParameters(**PUSH | changes)


def pushed(position_at):
    """Return the forces [N] on a point that is somewhere at each time, and the times."""
    block = LinkHand(
        LinkHandParameters("link_4", way=[0, 0.1, 0], begin=0.2, duration=0.3, hold=0.2), 1e-3
    )
    stepper, times = Stepper(block), 1e-3 * np.arange(1001)
    wrenches = np.array([stepper.step(point=position_at(time))["wrench"] for time in times])
    assert not wrenches[:, 3:].any()
    return times, wrenches[:, :3]


def test_the_motion_begins_at_the_grasped_position():
    time, found = pushed(lambda t: [0.5 * t, 0.0, 0.0])
    assert not found[time <= 0.2].any()
    k = np.flatnonzero(np.isclose(time, 0.6))[0]
    # the output at 0.6 s is what was seen a tick before
    expected = [-300 * (0.599 - 0.2) * 0.5 - 30 * 0.5, 300 * 0.1, 0.0]
    expected *= min(1.0, 45.0 / np.linalg.norm(expected)) * np.ones(3)
    assert found[k] == pytest.approx(expected, abs=1e-6)
    assert not found[time > 0.91].any()


def test_a_point_that_is_nowhere_is_let_go():
    time, found = pushed(lambda t: np.full(3, np.nan if t > 0.5 else 0.0))
    assert found[np.isclose(time, 0.49)].any()
    assert not found[time > 0.51].any()
    # and is taken hold of again, where the hand is by then
    time, found = pushed(lambda t: np.full(3, np.nan if 0.3 < t < 0.4 else 0.0))
    assert not found[(time > 0.302) & (time < 0.4)].any()
    assert found[np.isclose(time, 0.45)].any()
