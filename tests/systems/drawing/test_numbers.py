"""Numbers as strokes."""

import numpy as np
import pytest
from pydrake.geometry import Meshcat, MeshcatParams

from pfsc_drake.systems.drawing.numbers import SceneNumber

ACROSS = np.array([0.6, 0.8, 0.0])
PLACE = np.array([1.0, -2.0, 0.5])


def flat(number, height=0.1):
    """Return starts and ends across and up, in heights, shape (2, strokes, 2)."""
    points = SceneNumber(number, PLACE, ACROSS, height).strokes() - PLACE
    # nothing is beside the plane in which it stands
    np.testing.assert_allclose(points @ np.cross(ACROSS, [0.0, 0.0, 1.0]), 0.0, atol=1e-12)
    return np.stack([points @ ACROSS, points[..., 2]], axis=-1) / height


def length(strokes):
    return np.linalg.norm(strokes[1] - strokes[0], axis=1).sum()


@pytest.mark.parametrize("number", range(10))
def test_a_digit_stands_on_its_base(number):
    strokes = flat(number)
    assert strokes[..., 1].min() == pytest.approx(0.0, abs=1e-9)
    assert strokes[..., 1].max() == pytest.approx(1.0)
    assert np.abs(strokes[..., 0]).max() < 0.5


def test_digits_are_those_of_seven_segments():
    """An eight has all segments; the other digits are parts of it."""
    sizes = {k: length(flat(k)) for k in range(10)}
    upright, level = 1.0, 0.55
    expected = {0: (2, 2), 1: (1, 0), 2: (1, 3), 3: (1, 3), 4: (1.5, 1), 5: (1, 3), 6: (1.5, 3)}
    expected |= {7: (1, 1), 8: (2, 3), 9: (1.5, 3)}
    for digit, (uprights, levels) in expected.items():
        assert sizes[digit] == pytest.approx(uprights * upright + levels * level), digit
    pictures = {frozenset(map(tuple, np.round(flat(k).mean(axis=0), 6))) for k in range(10)}
    assert len(pictures) == 10


def test_digits_stand_side_by_side():
    strokes = flat(41)
    four, one = strokes[:, :3], strokes[:, 3:]
    assert four[..., 0].max() < one[..., 0].min()
    assert strokes[..., 0].min() + strokes[..., 0].max() == pytest.approx(0.0, abs=1e-9)


def test_strokes_are_as_bold_from_either_side():
    shown = SceneNumber(8, PLACE, ACROSS, 0.1)
    strokes = shown.strokes()
    vertices, triangles = shown.mesh()
    np.testing.assert_allclose((vertices - PLACE) @ [0.8, -0.6, 0.0], 0.0, atol=1e-12)
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    np.testing.assert_allclose(normals.sum(axis=0), 0.0, atol=1e-12)
    bold = 0.014
    area = np.linalg.norm(normals, axis=1).sum() / 2.0
    assert area == pytest.approx(2.0 * bold * (0.1 * length(flat(8)) + len(strokes[0]) * bold))


def test_a_number_is_drawn_at_its_path():
    meshcat = Meshcat(MeshcatParams(host="localhost"))
    SceneNumber(17, PLACE, ACROSS, 0.1).draw(meshcat, "fixtures/3/number")
    assert meshcat.HasPath("/drake/fixtures/3/number")
