"""Standard deviations of estimated links against each of their causes."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.estimation.link_deviation import (
    LinkDeviation,
    LinkErrors,
    StateUncertainty,
)
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import pose_function

NOTHING = np.zeros(3)
STATE = np.concatenate(
    [[0.3, 1.3, -0.5], [0.4, -0.7, 0.9], [0.301, 1.298, -0.4994], [0.5, -0.72, 0.9]]
)
BEND, SWING = STATE[6:9] - STATE[:3], STATE[9:] - STATE[3:6]


def deviations(robot, state=STATE, **errors):
    known = {"noise": np.zeros((2, 3)), "share": 0.0, "lag": 0.0}
    known |= dict.fromkeys(("coulomb", "stuck", "viscous"), NOTHING)
    return Stepper(LinkDeviation(robot, LinkErrors(**(known | errors)))).step(joint_state=state)


@pytest.mark.parametrize("kind", ["elastic", "mixed"])
def test_shares_and_noise_add_up_as_squares(drake_arm, kind):
    robot, noise = drake_arm(kind).chain, np.array([[2e-5, 1e-5, 0.0], [1e-3, 2e-3, 3e-3]])
    found = deviations(robot, noise=noise, share=0.05)
    expected = np.sqrt(noise[0] ** 2 + (0.05 * BEND) ** 2)
    np.testing.assert_allclose(found["position_deviation"], expected, rtol=1e-12)
    expected = np.sqrt(noise[1] ** 2 + (0.05 * SWING) ** 2)
    np.testing.assert_allclose(found["velocity_deviation"], expected, rtol=1e-12)


def test_torques_that_come_late(drake_arm):
    found = deviations(drake_arm("elastic").chain, lag=2e-3)
    np.testing.assert_allclose(found["position_deviation"], 2e-3 * np.abs(SWING), rtol=1e-12)
    assert "velocity_deviation" not in found


@pytest.mark.parametrize(
    ("speed", "torque"),
    [(0.0, 30.0 / np.sqrt(3.0)), (0.5, np.hypot(6.0, 0.5 * 4.0)), (-2.0, np.hypot(6.0, 8.0))],
)
def test_friction_is_an_error_while_joints_move_and_anything_while_they_rest(
    drake_arm, speed, torque
):
    robot, state, three = drake_arm("mixed").chain, STATE.copy(), np.ones(3)
    state[3:6] = state[9:] = speed
    found = deviations(
        robot, state, lag=1e-3, coulomb=6.0 * three, stuck=30.0 * three, viscous=4.0 * three
    )
    expected = np.where(robot.elastic_joints, torque / robot.K_s, 0.0)
    np.testing.assert_allclose(found["position_deviation"], expected, rtol=1e-12)


def test_the_tool_point_against_links_that_are_drawn(drake_arm):
    """So small that the tool moves in proportion."""
    robot = drake_arm("elastic").chain
    sigma = np.array([3e-5, 1e-5, 8e-5])
    found = deviations(robot, noise=np.array([sigma, NOTHING]))
    rng, count = np.random.default_rng(3), 4000
    q = STATE[:3] + sigma * rng.standard_normal((count, 3))
    y = np.array(pose_function(robot).map(count)(q.T)).T[:, :3]
    np.testing.assert_allclose(found["tool_deviation"], y.std(axis=0), rtol=0.05)


@pytest.mark.parametrize(
    "options", [{"stiffness": 0.6}, {"torque_scale": -0.1}, {"coulomb": -1.0}, {"friction": np.inf}]
)
def test_numbers_out_of_range(options):
    with pytest.raises(InputError, match="allowed"):
        StateUncertainty(**options)
