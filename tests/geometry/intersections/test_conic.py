"""Lines and ellipses known by their points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pfsc_drake.geometry.intersections.edge import line_or_ellipse

ANGLES = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)


def ellipse(seed, ratio, bump=0.0):
    """Return points of an ellipse anywhere, and its matrix ``[center, u, v]``, [3, 3]."""
    generator = np.random.default_rng(seed)
    u, v, _ = np.linalg.qr(generator.standard_normal((3, 3)))[0]
    matrix = np.array([generator.uniform(-1.0, 1.0, 3), 0.2 * u, 0.2 * ratio * v])
    angles = ANGLES + generator.uniform(0.0, 6.0)
    wave = bump * np.cos(3.0 * angles)[:, None] * u
    return np.column_stack([np.ones(40), np.cos(angles), np.sin(angles)]) @ matrix + wave, matrix


@given(st.integers(0, 10_000), st.floats(0.05, 1.0))
def test_an_ellipse_goes_through_its_points_from_the_first_on(seed, ratio):
    points, matrix = ellipse(seed, ratio)
    curve = line_or_ellipse(points, is_closed=True)
    np.testing.assert_allclose(curve.constant, matrix[0], rtol=0, atol=1e-10)
    result = curve.derivatives(ANGLES, 0)[:, 0]
    np.testing.assert_allclose(result, points, rtol=0, atol=1e-9)


@pytest.mark.parametrize("bump", [1e-3, 1e-8])
def test_what_is_nearly_an_ellipse_is_none(bump):
    points, _ = ellipse(1, 0.6, bump)
    assert line_or_ellipse(points, is_closed=True) is None


def test_lines_and_what_is_none():
    share = np.linspace(0.0, 1.0, 9)[:, None] ** 2
    points = [0.1, 0.2, 0.3] + share * [0.3, -0.4, 1.2]
    curve = line_or_ellipse(points, is_closed=False)
    np.testing.assert_allclose(curve.derivatives(curve.domain, 0)[:, 0], points[[0, -1]])
    assert curve.period == pytest.approx(1.3)
    assert line_or_ellipse(points + 1e-8 * np.sin(9.0 * share), is_closed=False) is None
    arc, _ = ellipse(2, 0.7)
    assert line_or_ellipse(arc[:20], is_closed=False) is None
    twisted = arc + 0.01 * np.column_stack([np.sin(2.0 * ANGLES)] * 3)
    assert line_or_ellipse(twisted, is_closed=True) is None
