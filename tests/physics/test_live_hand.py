"""What is asked of a hand, and the force that comes of it."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.errors import InputError
from pfsc_drake.physics.live_hand import LiveHand, LiveHandParameters

PERIOD = 1e-3
HAND = LiveHandParameters(stiffness=400.0, damping=30.0, rotational_damping=0.3)
AT_HOME = np.concatenate([[0.8, 0.1, 0.9], np.eye(3).ravel()])


def ask(push=(0.0, 0.0, 0.0), hold=0.0, target=(0.0, 0.0, 0.0)):
    return np.concatenate([push, [hold], target])


def person():
    return Stepper(LiveHand(HAND, PERIOD))


def follow(stepper, asked, poses):
    """Return the wrenches that answer poses."""
    wrenches = []
    for pose in poses:
        stepper.step(asked=asked, tool_pose=pose)
        wrenches.append(stepper.states["wrench"])
    return np.array(wrenches)


def test_a_push_comes_as_two_lags_let_it():
    wrenches = follow(person(), ask(push=(0.0, 20.0, 0.0)), [AT_HOME] * 400)
    t = PERIOD * np.arange(1, 401) / HAND.response_time
    expected = 20.0 * (1.0 - (1.0 + t) * np.exp(-t))
    assert np.abs(wrenches[:, 1] - expected).max() < 0.02 * 20.0
    assert np.abs(np.diff(wrenches[:, 1])).max() < 20.0 / np.e * PERIOD / HAND.response_time * 1.05
    assert not wrenches[:, [0, 2, 3, 4, 5]].any()


def test_a_holding_hand_is_a_spring_and_a_damper():
    stepper, target = person(), AT_HOME[:3] + np.array([0.03, 0.0, -0.02])
    asked = ask(hold=1.0, target=target)
    wrenches = follow(stepper, asked, [AT_HOME] * 1500)
    assert wrenches[-1][:3] == pytest.approx(400.0 * np.array([0.03, 0.0, -0.02]), abs=1e-6)
    velocity, spin = np.array([0.1, -0.2, 0.05]), 0.4
    c, s = np.cos(spin * PERIOD), np.sin(spin * PERIOD)
    before = AT_HOME.copy()
    before[:3] -= PERIOD * velocity
    before[3:] = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]).ravel()
    moving = follow(stepper, asked, [before, AT_HOME])
    assert moving[1][:3] - wrenches[-1][:3] == pytest.approx(-30.0 * velocity, abs=1e-6)
    assert moving[1][3:] == pytest.approx([0.0, 0.0, -0.3 * spin], abs=1e-6)


def test_it_is_no_stronger_than_its_limit():
    far = AT_HOME[:3] + np.array([3.0, 4.0, 0.0])
    wrenches = follow(person(), ask(push=(0.0, 0.0, 40.0), hold=1.0, target=far), [AT_HOME] * 1000)
    sizes = np.linalg.norm(wrenches[:, :3], axis=1)
    assert sizes.max() == pytest.approx(45.0, rel=1e-9)
    assert wrenches[-1][:3] == pytest.approx(45.0 * np.array([1200, 1600, 40]) / 2000.4, rel=1e-3)


def test_an_open_hand_closes_where_it_is_asked_to_hold():
    """Not on the way from where it held before; and nothing pulls while it closes."""
    stepper = person()
    follow(stepper, ask(hold=1.0, target=(5.0, 5.0, 5.0)), [AT_HOME] * 500)
    follow(stepper, ask(), [AT_HOME] * 1000)
    wrenches = follow(stepper, ask(hold=1.0, target=AT_HOME[:3]), [AT_HOME] * 500)
    assert np.abs(wrenches).max() < 1e-3


def test_it_holds_its_wrench_until_the_next_look():
    stepper = person()
    before = [np.zeros(6), *follow(stepper, ask(push=(5.0, 0.0, 0.0)), [AT_HOME] * 20)]
    shown = stepper.step(asked=ask(), tool_pose=AT_HOME)["wrench"]
    assert np.array_equal(shown, before[-1])


def test_it_does_nothing_to_a_tool_that_is_nowhere_and_goes_on_after():
    poses = [AT_HOME] * 50 + [AT_HOME * np.nan] + [AT_HOME] * 2
    asked = ask(push=(5.0, 0.0, 0.0), hold=1.0, target=(0.9, 0.1, 0.8))
    forces = np.linalg.norm(follow(person(), asked, poses), axis=1)
    assert forces[49] > 1.0
    assert forces[50] == 0.0
    assert forces[52] > forces[49]


@pytest.mark.parametrize(
    ("key", "value"), [("force_limit", 0.0), ("damping", -1.0), ("response_time", np.nan)]
)
def test_what_no_hand_has_is_refused(key, value):
    with pytest.raises(InputError, match=f"{key} = {value}"):
        LiveHandParameters(**{key: value})
