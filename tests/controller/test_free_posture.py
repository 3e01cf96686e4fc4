"""Posture of redundant joints: limits of speeds and ends."""

import numpy as np
import pytest

from pfsc_drake.control.law.stabilization import Stabilization, gains_from_poles
from pfsc_drake.controller.free_posture import _goal, make_posture
from pfsc_drake.controller.options.controller_parameters import PostureParameters
from pfsc_drake.errors import InputError


def test_a_posture_leaves_room_to_speeds_and_ends(load_arm):
    chain = load_arm("franka_emika_panda").chain
    gains = Stabilization([gains_from_poles([-5.0, -5.0])] * 7, 2, ["posture"] * 7)
    posture = make_posture(PostureParameters(), chain, gains, None)
    limits, speeds = chain.gather("position_limits"), chain.gather("velocity_limit")
    np.testing.assert_allclose(posture.speeds, 0.8 * speeds)
    np.testing.assert_allclose(posture.ends[0] - limits[:, 0], 0.02)
    np.testing.assert_allclose(limits[:, 1] - posture.ends[1], 0.02)


def test_goals_are_in_degrees_and_of_slides_in_metres(load_arm):
    chain = load_arm("scara_600").chain
    turns = chain.gather("is_revolute")
    given = np.where(turns, 30.0, -0.05)
    goal = _goal(PostureParameters(reference_deg=given.tolist()), chain)
    np.testing.assert_allclose(goal, np.where(turns, np.pi / 6.0, -0.05))
    slide = int(np.flatnonzero(~turns)[0])
    given[slide] = 30.0
    with pytest.raises(InputError, match=r"reference_deg: 30 of .* m$"):
        _goal(PostureParameters(reference_deg=given.tolist()), chain)
