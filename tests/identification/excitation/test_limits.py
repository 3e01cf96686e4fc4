"""Limits of joints."""

import numpy as np
import pytest

from identification.excitation.limits import chosen_limits, used_shares
from pfsc_drake.errors import InputError


def test_tab_c_1(comau):
    limits = chosen_limits(comau)
    np.testing.assert_allclose(np.rad2deg(limits.position[1]), [-65.0, 175.0], rtol=1e-6)
    np.testing.assert_allclose(
        np.rad2deg(limits.velocity), [220, 250, 300, 550, 550, 600], rtol=1e-6
    )
    np.testing.assert_allclose(
        np.rad2deg(limits.acceleration), [400, 550, 666, 1270, 1270, 1390], rtol=1e-6
    )


def test_other_limits_for_all_or_for_one_joint(comau):
    limits = chosen_limits(comau, {"velocity": 1.0, "effort": {"joint_2": 700.0}})
    np.testing.assert_array_equal(limits.velocity, np.ones(6))
    assert limits.effort[1] == 700.0
    assert limits.effort[0] == comau.effort_limit[0]
    assert chosen_limits(comau, limits) is limits


def test_shares(comau):
    limits = chosen_limits(comau)
    q = np.vstack([limits.position[:, 1], limits.middle])
    v, a, tau = (
        np.vstack([x, -share * x])
        for x, share in ((limits.velocity, 1.2), (limits.acceleration, 0.1), (limits.effort, 0.5))
    )
    shares = used_shares(limits, (q, v, a), 0.5 * tau)
    for key, expected in (("position", 1.0), ("velocity", 1.2), ("acceleration", 1.0)):
        np.testing.assert_allclose(shares[key], expected)
    np.testing.assert_allclose(shares["effort"], 0.5)
    narrower = limits.shrink(0.5)
    np.testing.assert_allclose(narrower.middle, limits.middle)
    np.testing.assert_allclose(narrower.reach, 0.5 * limits.reach)


@pytest.mark.parametrize(
    ("limits", "says"),
    [
        ({"speed": 1.0}, "limits: 'speed'; must be one of position, velocity"),
        ({"velocity": {"joint_9": 1.0}}, "has no joint 'joint_9'; must be one of joint_1"),
        ({"velocity": "fast"}, "velocity limits = 'fast'; must be numbers"),
        ({"velocity": {"joint_1": [1.0, 2.0]}}, r"velocity limit of joint_1: shape \(2,\)"),
        ({"velocity": -1.0}, "velocity limit of joint_1 = -1; must be positive"),
        ({"velocity": [1.0, 2.0]}, r"velocity limits: shape \(2,\); must be one number or 6"),
        ({"position": {"joint_2": [1.0, -1.0]}}, "joint_2 = .*lower must be below upper"),
        ({"position": {"joint_1": [-np.inf, 1.0]}}, "no position limits of joint_1; give them"),
    ],
)
def test_refuses(comau, limits, says):
    with pytest.raises(InputError, match=says):
        chosen_limits(comau, limits)


def test_refuses_what_the_model_does_not_know(delta):
    with pytest.raises(InputError, match=r"no acceleration limits of .*; give them"):
        chosen_limits(delta)
