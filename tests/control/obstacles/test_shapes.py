"""Shapes of obstacles and their parts."""

import pytest

from pfsc_drake.control.obstacles.shapes import Capsule, ObstacleShape
from pfsc_drake.errors import InputError


def test_a_person_stands_on_the_floor_and_has_the_given_height():
    trunk, head = ObstacleShape("person", 0.25, 1.8).parts
    assert trunk.start[2] - trunk.radius == pytest.approx(0.0)
    assert head.start[2] + head.radius == pytest.approx(1.8)
    # no gap at the neck
    assert trunk.end[2] + trunk.radius == pytest.approx(head.start[2] - head.radius)
    assert head.is_sphere
    assert not trunk.is_sphere


def test_parts_are_the_capsules():
    beam = Capsule((-0.5, 0.0, 1.0), (0.5, 0.0, 1.0), 0.05)
    assert ObstacleShape("capsules", 0.25, capsules=(beam,)).parts == (beam,)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("cube", 0.2), "kind"),
        (("sphere", 0.0), "radius"),
        (("person", 0.25, 0.6), "height = 0.6"),
        (("capsules", 0.2), "parts = none"),
        (("sphere", 0.2, 1.75, (Capsule((0, 0, 0), (0, 0, 1), 0.1),)), "parts = given"),
    ],
)
def test_wrong_obstacles_are_rejected(arguments, message):
    with pytest.raises(InputError, match=message):
        ObstacleShape(*arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((0, 0), (0, 0, 1), 0.1), "start"),
        (((0, 0, 0), (0, 0, float("nan")), 0.1), "end"),
        (((0, 0, 0), (0, 0, 1), -0.1), "radius"),
    ],
)
def test_wrong_capsules_are_rejected(arguments, message):
    with pytest.raises(InputError, match=message):
        Capsule(*arguments)
