"""What pushes an elbow, against a potential of Drake's places of its points."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.obstacles.elbow_room import ElbowParameters, ElbowRoom
from pfsc_drake.control.obstacles.shapes import ObstacleShape
from pfsc_drake.errors import InputError
from pfsc_drake.robot.serial.outline import arm_outline, outline_points
from tests.control.conftest import BENT_7

PARAMETERS = ElbowParameters(room=0.4, stiffness=150.0, force_limit=30.0)
Q = np.array(BENT_7)


def _torque(room, obstacle, q=Q):
    state = np.concatenate([q, np.zeros(7), q, np.zeros(7)])
    return room.step(joint_state=state, obstacles=obstacle)["torque"]


@pytest.mark.parametrize("kind", ["sphere", "column"])
def test_the_torque_is_that_of_a_spring_that_is_limited(load_robot, kind):
    chain, shape = load_robot("franka_emika_panda").chain, ObstacleShape(kind, 0.1)
    outline = arm_outline(chain, 0.08)
    points = outline_points(chain, outline)
    place = points(Q).full().ravel()[3:6] + np.array([0.0, -0.4, 0.05])
    room = Stepper(ElbowRoom(chain, outline, [shape], PARAMETERS, 0.1))

    def energy(q):
        total = 0.0
        for p in points(q).full().reshape(-1, 3)[:-1]:
            away = (p - place) * shape.axes.full().ravel()
            left = PARAMETERS.room - (np.linalg.norm(away) - 0.18)
            longest = PARAMETERS.force_limit / PARAMETERS.stiffness
            near = np.clip(left, 0.0, longest)
            total += PARAMETERS.stiffness * (near**2 / 2 + longest * max(left - longest, 0.0))
        return total

    step = 1e-5 * np.eye(7)
    expected = [-(energy(Q + d) - energy(Q - d)) / 2e-5 for d in step]
    # at rest where it will be when it is used
    torque = _torque(room, np.append(place, np.zeros(3)))
    assert np.abs(torque).max() > 1.0
    np.testing.assert_allclose(torque, expected, atol=1e-5)
    moving = np.append(place - 0.1 * np.array([0.3, 0.0, 0.0]), [0.3, 0.0, 0.0])
    np.testing.assert_allclose(_torque(room, moving), torque, atol=1e-9)


def test_what_is_far_or_no_number_pushes_nothing(load_robot):
    chain = load_robot("franka_emika_panda").chain
    outline = arm_outline(chain, 0.08)
    room = Stepper(ElbowRoom(chain, outline, [ObstacleShape("sphere", 0.1)], PARAMETERS, 0.1))
    assert not _torque(room, np.array([3.0, 0, 0, 0, 0, 0])).any()
    assert not _torque(room, np.full(6, np.nan)).any()


def test_no_room_is_refused():
    with pytest.raises(InputError, match="room"):
        ElbowParameters(room=0.0)
