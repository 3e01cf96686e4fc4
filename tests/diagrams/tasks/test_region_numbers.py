"""Positions of the numbers of regions in a scene."""

import numpy as np

from diagrams.tasks.drawing import region_numbers


def square(x, y, z, side=0.4):
    """Return an upright square, 2 by 2 points."""
    ends = np.array([-side / 2.0, side / 2.0])
    grid = np.stack(np.meshgrid(ends, [0.0], ends, indexing="ij"), axis=-1)[:, 0]
    return grid + np.array([x, y, z])


def test_a_single_region_needs_no_number():
    assert region_numbers([square(1.0, 0.0, 0.5)] * 6, [0]) == {}


def test_a_number_stands_next_to_who_looks_and_in_order():
    """The robot is at the origin, the regions before it, and who looks has it to the left."""
    skins = [square(1.0, 0.4, 0.5), square(1.0, 0.0, 0.5), square(1.0, -0.4, 0.5, side=0.04)]
    numbers = region_numbers(skins, [0, 2])
    assert [shown.number for shown in numbers.values()] == [1, 2]
    assert list(numbers) == [0, 2]
    for first, end in ((0, 2), (2, 3)):
        shown, points = numbers[first], np.concatenate(skins[first:end]).reshape(-1, 3)
        # who looks stands at negative y, and sees the robot's x to the right
        assert shown.across[0] > 0.5
        assert shown.across[2] == 0.0
        np.testing.assert_allclose(np.linalg.norm(shown.across), 1.0)
        near = points[np.argmin(np.linalg.norm(points - shown.base, axis=1))]
        assert near[1] == points[:, 1].min()
        assert np.linalg.norm(near - shown.base) < 1.5 * shown.height
        assert shown.base[1] < near[1]
    # a small region has a small number
    assert numbers[2].height < 0.03 < numbers[0].height


def test_numbers_turn_with_where_the_regions_are():
    ahead = region_numbers([square(1.0, 0.3, 0.5), square(1.0, -0.3, 0.5)], [0, 1])
    aside = region_numbers([square(-0.3, 1.0, 0.5), square(0.3, 1.0, 0.5)], [0, 1])
    x, y, _ = ahead[0].across
    np.testing.assert_allclose(aside[0].across, [-y, x, 0.0], atol=1e-12)
