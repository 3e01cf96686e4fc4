"""Spacing, normals and roughness of scattered points."""

import numpy as np
import pytest

from pfsc_drake.geometry.surfaces.choose_base import neighbourhoods


def grid(step, count, noise=0.0, begin=0.0):
    x, y = np.stack(np.meshgrid(*[step * np.arange(count)] * 2), axis=-1).reshape(-1, 2).T
    return np.stack([begin + x, y, noise * np.random.default_rng(1).normal(size=len(x))], axis=1)


def test_points_stand_as_most_of_them_do():
    """A fine grid of 400 points, and 100 ten times as far apart."""
    near = neighbourhoods(np.concatenate([grid(0.01, 20), grid(0.1, 10, begin=1.0)]))
    assert near.spacing == pytest.approx(0.01)
    np.testing.assert_allclose(np.abs(near.normals[:, 2]), 1.0, atol=1e-9)
    assert near.thickness < 1e-9


def test_roughness_is_that_of_most_points():
    """Of 16 in a plane with noise s, which three of them take away: s sqrt(13 / 16) and less."""
    smooth, rough = grid(0.01, 20, 1e-4), grid(0.01, 10, 1e-3, begin=1.0)
    near = neighbourhoods(np.concatenate([smooth, rough]))
    assert near.thickness == pytest.approx(1e-4 * np.sqrt(13.0 / 16.0), rel=0.1)
