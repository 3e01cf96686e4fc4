"""Torques on an elbow against a potential over the positions of its points from Drake."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.obstacles.elbow_clearance import ElbowClearance, ElbowParameters
from pfsc_drake.control.obstacles.shapes import ObstacleShape
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.outline import arm_outline, outline_points
from tests.control.conftest import BENT_7

PARAMETERS = ElbowParameters(room=0.4, stiffness=150.0, force_limit=30.0)
Q = np.array(BENT_7)


def _torque(clearance, obstacle, q=Q):
    state = np.concatenate([q, np.zeros(7), q, np.zeros(7)])
    return clearance.step(joint_state=state, obstacles=obstacle)["torque"]


@pytest.mark.parametrize("kind", ["sphere", "column"])
def test_the_torque_is_that_of_a_limited_spring(load_robot, kind):
    chain, shape = load_robot("franka_emika_panda").chain, ObstacleShape(kind, 0.1)
    outline = arm_outline(chain, 0.08)
    points = outline_points(chain, outline)
    p_O = points(Q).full().ravel()[3:6] + np.array([0.0, -0.4, 0.05])
    clearance = Stepper(ElbowClearance(chain, outline, [shape], PARAMETERS, 0.1))

    def energy(q):
        total = 0.0
        for p in points(q).full().reshape(-1, 3)[:-1]:
            away = (p - p_O) * shape.axes.full().ravel()
            left = PARAMETERS.room - (np.linalg.norm(away) - 0.18)
            longest = PARAMETERS.force_limit / PARAMETERS.stiffness
            near = np.clip(left, 0.0, longest)
            total += PARAMETERS.stiffness * (near**2 / 2 + longest * max(left - longest, 0.0))
        return total

    step = 1e-5 * np.eye(7)
    expected = [-(energy(Q + d) - energy(Q - d)) / 2e-5 for d in step]
    # at rest at the predicted position
    torque = _torque(clearance, np.append(p_O, np.zeros(3)))
    assert np.abs(torque).max() > 1.0
    np.testing.assert_allclose(torque, expected, atol=1e-5)
    moving = np.append(p_O - 0.1 * np.array([0.3, 0.0, 0.0]), [0.3, 0.0, 0.0])
    np.testing.assert_allclose(_torque(clearance, moving), torque, atol=1e-9)


def test_no_torque_far_away_or_for_nan(load_robot):
    chain = load_robot("franka_emika_panda").chain
    outline = arm_outline(chain, 0.08)
    clearance = Stepper(
        ElbowClearance(chain, outline, [ObstacleShape("sphere", 0.1)], PARAMETERS, 0.1)
    )
    assert not _torque(clearance, np.array([3.0, 0, 0, 0, 0, 0])).any()
    assert not _torque(clearance, np.full(6, np.nan)).any()


def test_zero_distance_is_rejected():
    with pytest.raises(InputError, match="room"):
        ElbowParameters(room=0.0)
