"""Nearest places on a line of samples, against many more samples of it."""

import numpy as np
import pytest

from experiments.teaching.comparison import NearestOnLine


def curve(t):
    return np.stack([t, np.sin(3.0 * t), 0.2 * t**2], axis=1)


def test_it_is_as_near_as_any_of_many_samples():
    line, fine = curve(np.linspace(0.0, 2.0, 201)), np.linspace(0.0, 2.0, 20_001)
    dense = np.stack([np.interp(fine, np.linspace(0, 2, 201), c) for c in line.T], axis=1)
    points = curve(np.linspace(0.05, 1.95, 40)) + 0.01 * np.random.default_rng(3).normal(
        size=(40, 3)
    )
    nearest = NearestOnLine(points, line)
    brute = np.linalg.norm(points[:, None] - dense[None], axis=2).min(axis=1)
    assert nearest.distances == pytest.approx(brute, abs=2e-6)
    feet = nearest.at(line)
    assert np.linalg.norm(points - feet, axis=1) == pytest.approx(nearest.distances, abs=1e-12)


def test_samples_that_coincide_and_ends():
    line = np.array([[0.0, 0, 0], [0, 0, 0], [1, 0, 0], [1, 0, 0]])
    points = np.array([[-1.0, 0, 0], [0.25, 2.0, 0], [3.0, 0, 0]])
    nearest = NearestOnLine(points, line)
    assert nearest.distances == pytest.approx([1.0, 2.0, 2.0])
    assert nearest.at(line)[:, 0] == pytest.approx([0.0, 0.25, 1.0])
    assert NearestOnLine(points, line[:1]).distances == pytest.approx(
        np.linalg.norm(points, axis=1)
    )
