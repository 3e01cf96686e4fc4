"""Places that a hand goes to at random."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.physics.hand_model import HandModel, HandParameters, Wander

BOX = {"low": [0.1, -0.2, 0.5], "high": [0.3, 0.2, 0.9]}


def test_targets_are_within_the_box_and_times_within_their_bounds():
    wander = Wander(**BOX, begin=0.5, end=20.0, shortest=0.3, longest=0.8)
    times, targets = wander.target_points(3)
    assert times[0] == 0.5
    assert 18.0 < times[-1] < 20.0
    gaps = np.diff(times)
    assert gaps.min() >= 0.3
    assert gaps.max() <= 0.8
    assert np.all((targets >= BOX["low"]) & (targets <= BOX["high"]))
    assert np.ptp(targets, axis=0) == pytest.approx([0.2, 0.4, 0.4], rel=0.2)


def test_a_hand_goes_there_as_its_seed_says():
    wander = Wander(**BOX, begin=0.5, end=5.0)
    hands = [HandModel(HandParameters(wander=wander, seed=seed)) for seed in (1, 1, 2)]
    times, targets = wander.target_points(1)
    for time, target in zip(times, targets, strict=True):
        first, again = (ca.evalf(hand.target(time)[0]).full().ravel() for hand in hands[:2])
        np.testing.assert_allclose(first, target, atol=1e-12)
        np.testing.assert_array_equal(first, again)
    first, other = (ca.evalf(hands[i].target(3.0)[0]).full() for i in (0, 2))
    assert not np.array_equal(first, other)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"low": [0.4, 0, 0]}, "low, high"),
        ({"high": [1.0, 1.0]}, "low, high"),
        ({"begin": 2.0}, "begin, end"),
        ({"end": np.inf}, "begin, end"),
        ({"shortest": 0.0}, "shortest, longest"),
        ({"longest": 0.1}, "shortest, longest"),
    ],
)
def test_refusals(change, name):
    with pytest.raises(InputError, match=name):
        Wander(**BOX | change)
