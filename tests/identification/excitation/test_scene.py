"""A robot and its cell in Drake's geometry engine."""

import numpy as np
import pytest

from identification.excitation.balls import cover
from identification.excitation.scene import Cell, Obstacle, RobotScene, cell_of
from pfsc_drake.errors import InputError


def ball(center, **more):
    return Obstacle(name="ball", kind="sphere", center=np.array(center), radius=0.1, **more)


def test_distance_to_a_ball_far_away(comau):
    scene = RobotScene(comau, Cell([ball([0.0, 10.0, 0.0])], self_collision=False))
    q = np.zeros((1, 6))
    q[0, 1] = np.pi / 2
    found = scene.distances(q)
    # Drake's distance to the same ball further away is as much larger
    further = RobotScene(comau, Cell([ball([0.0, 1000.0, 0.0])], self_collision=False))
    assert further.distances(q).min() - found.min() == pytest.approx(990.0, abs=0.5)
    assert scene.pairs[int(found.argmin())].name.endswith("ball")


def test_neighbours_and_joined_links_are_no_pairs(comau_scene):
    names = {pair.name for pair in comau_scene.pairs}
    assert "link_2 and link_3" not in names
    assert "link_4 and link_6" not in names
    assert "link_1 and socket" not in names
    assert {"link_3 and socket", "link_6 and floor", "link_2 and link_5"} <= names


def test_body_left_out_of_an_obstacle(comau):
    scene = RobotScene(comau, Cell([ball([5, 0, 0], beside=["link_6"])], self_collision=False))
    assert {pair.name for pair in scene.pairs} == {f"link_{i} and ball" for i in range(1, 6)}


def test_overlap_is_negative(comau):
    plain = RobotScene(comau, Cell(self_collision=False))
    q = np.array([[0.3, 1.0, -0.2, 0.5, 0.4, 0.1]])
    balls = cover(comau.chain, plain)
    center = balls.sample(q)[0, np.flatnonzero(balls.links == 2)[0]]
    scene = RobotScene(comau, Cell([ball(center)], self_collision=False))
    assert scene.distances(q).min() < 0.0


def test_refuses(comau, delta, tmp_path):
    with pytest.raises(InputError, match="beside = 'link_9'; must be one of"):
        RobotScene(comau, Cell([ball([1, 0, 0], beside=["link_9"])]))
    with pytest.raises(InputError, match="serial robots only"):
        RobotScene(delta, Cell())
    with pytest.raises(InputError, match="tool_above"):
        Cell(tool_above=np.nan)
    file = tmp_path / "cell.yaml"
    file.write_text("obstacles:\n  - {name: x, kind: pyramid}\n")
    with pytest.raises(InputError, match=r"cell\.yaml"):
        cell_of(comau, file)
