"""Polygons with blended corners."""

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.rounded_polygon import blend_distances, round_corners

CORNERS = np.array([[0, 0, 0], [0.3, 0, 0], [0.3, 0.2, 0], [0.1, 0.2, 0.1], [0, 0.1, 0.1]], float)


def _rounded(smoothness: int, closed: bool, distance: float = 0.03):
    points = np.vstack([CORNERS, CORNERS[:1]]) if closed else CORNERS
    theta = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    widths = blend_distances(points, distance, closed=closed)
    curve = round_corners(points, theta, widths, smoothness=smoothness, closed=closed)
    return points, theta, widths, curve


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("smoothness", [2, 3, 4, 5, 6])
def test_class_at_every_joint(smoothness: int, closed: bool) -> None:
    _, _, widths, curve = _rounded(smoothness, closed)
    assert (curve.closed, curve.smoothness) == (closed, smoothness)
    ends = curve.breakpoints if closed else curve.breakpoints[1:-1]
    step = 1e-10
    grid = np.linspace(*curve.domain, 4000)
    for order in range(smoothness + 1):
        size = np.abs(curve.derivatives(grid, order)[:, order]).max()
        left, right = (curve.derivatives(ends + sign * step, order) for sign in (-1, 1))
        # a derivative may change by its own rate over the step, and by rounding errors
        allowed = 1e-6 * size + 1e-13 / (0.1 * widths.min()) ** order
        np.testing.assert_allclose(left[:, order], right[:, order], atol=allowed)


@pytest.mark.parametrize("closed", [False, True])
def test_straight_beyond_the_distance_and_inside_of_the_corner(closed: bool) -> None:
    points, theta, widths, curve = _rounded(5, closed)
    inner = widths[1:] if closed else widths
    directions = np.diff(points, axis=0) / np.diff(theta)[:, None]
    grid = np.linspace(*curve.domain, 5000, endpoint=False)
    side = np.searchsorted(theta, grid, side="right") - 1
    on_polygon = points[side] + (grid - theta[side])[:, None] * directions[side]
    sigma = curve.derivatives(grid, 0)[:, 0]
    off = np.linalg.norm(sigma - on_polygon, axis=1)
    gap = np.abs(grid[:, None] - theta[1:-1])
    near = (gap < inner).any(axis=1)
    if closed:
        near |= (grid < widths[0]) | (grid > theta[-1] - widths[0])
    np.testing.assert_allclose(off[~near], 0.0, atol=1e-15)
    assert 0.0 < off.max() < 0.03
    for corner in range(1, len(points) - 1):
        # within the triangle: both coordinates along the sides positive, their sum below one
        inside = np.abs(grid - theta[corner]) < inner[corner - 1]
        sides = inner[corner - 1] * np.stack([-directions[corner - 1], directions[corner]], axis=1)
        local = np.linalg.lstsq(sides, (sigma[inside] - points[corner]).T, rcond=None)[0]
        assert local.min() > -1e-12
        assert local.sum(axis=0).max() < 1.0 + 1e-12


def test_turns_to_one_side_only() -> None:
    points = CORNERS[:3]
    curve = round_corners(
        points, np.array([0.0, 0.3, 0.5]), np.array([0.05]), smoothness=5, closed=False
    )
    _, d1, d2 = curve.derivatives(np.linspace(0.0, 0.5, 2000), 2).transpose(1, 0, 2)
    assert np.cross(d1, d2)[:, 2].min() >= -1e-12
    # slope of one at both ends, never slower than at the middle of a right angle
    speed = np.linalg.norm(d1, axis=1)
    assert speed.min() == pytest.approx(np.sqrt(0.5), rel=1e-4)


def test_short_sides_leave_room_for_both_neighbours() -> None:
    points, theta, widths, curve = _rounded(3, True, distance=1.0)
    sides = np.diff(theta)
    np.testing.assert_allclose(widths[0], min(sides[-1], sides[0]) / 2.0)
    np.testing.assert_allclose(widths[1:], np.minimum(sides[:-1], sides[1:]) / 2.0)
    assert np.diff(curve.breakpoints).min() > 1e-6
    # the seam lies on the middle of the first corner's blend
    start, end = curve.derivatives(np.array([1e-12, curve.domain[1] - 1e-12]), 2)
    np.testing.assert_allclose(start, end, atol=1e-8)
    assert len(points) == 6


def test_a_corner_that_turns_back_is_refused() -> None:
    back = np.array([[0, 0, 0], [0.3, 0, 0], [0.0, 0.001, 0]])
    with pytest.raises(InputError, match=r"turns by 179\.8 deg at waypoint 2; at most 170 deg"):
        blend_distances(back, 0.01, closed=False)
