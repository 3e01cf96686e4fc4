"""The nearest place of a path to a point that moves, against samples and closed forms."""

import math

import numpy as np
import pytest

from pfsc_drake.geometry import FourierCurve, Path, PiecewisePolynomialCurve
from pfsc_drake.geometry.paths.nearest_projection import NearestProjection

LEMNISCATE = Path(FourierCurve.bent_lemniscate())
LINE = Path(PiecewisePolynomialCurve.line([0.0, 0.0, 0.0], [0.3, 0.0, 0.0]))
CIRCLE = Path(FourierCurve.circle([0.0, 0.0, 0.0], 0.1, [1, 0, 0], [0, 1, 0]))


def samples(path, count=5001):
    theta = np.linspace(*path.position.domain, count)
    return path.position.derivatives(theta, 0)[:, 0]


def wander(seed, ticks, box, speed=0.5):
    """A point that moves to and fro in a box, by at most 0.5 mm in a tick."""
    rng = np.random.default_rng(seed)
    low, high = box
    y, v, way = (low + high) / 2.0, np.zeros(3), []
    for _ in range(ticks):
        v += -2e-3 * v + 0.03 * rng.normal(size=3)
        y = np.clip(y + 1e-3 * np.clip(v, -speed, speed), low, high)
        way.append(y)
    return np.array(way)


@pytest.mark.slow
def test_a_nearer_part_of_the_path_is_found_within_its_ticks():
    """But for what half the way between two samples that are looked at is worth."""
    points = samples(LEMNISCATE)
    box = points.min(axis=0) - 0.05, points.max(axis=0) + 0.05
    place = NearestProjection(LEMNISCATE)
    half, found = LEMNISCATE.length / 256.0, np.array([])
    for seed in range(2):
        way = wander(seed, 1500, box)
        distances = place.distances(way)
        least = np.array([np.min(np.linalg.norm(points - y, axis=1)) for y in way])
        assert np.all(distances > least - 1e-6)
        late = np.concatenate([[False], distances**2 > least**2 + half**2, [False]])
        begins, ends = np.flatnonzero(np.diff(late.astype(int))).reshape(-1, 2).T
        found = np.append(found, ends - begins)
    assert found.size > 0  # other parts did come nearer
    assert found.max() <= place.ticks


def test_no_step_leads_farther_away_than_the_last_projection():
    """However wrong that is: this is what the energy of guides rests on."""
    rng = np.random.default_rng(3)
    function = NearestProjection(LEMNISCATE).function
    at = LEMNISCATE.evaluator(1).at
    position = LEMNISCATE.evaluator(1).layout.position
    for tick in range(300):
        y = rng.uniform([0.3, 0.0, 0.9], [1.1, 0.4, 1.4])
        last = rng.uniform(-10.0, 10.0)
        before = np.array(at(last)).ravel()[position][:3]
        theta, _, now = (np.array(x).ravel() for x in function(y, last, tick))
        assert np.linalg.norm(y - now) <= np.linalg.norm(y - before) + 1e-12
        np.testing.assert_allclose(np.array(at(theta)).ravel()[position][:3], now, atol=1e-12)


@pytest.mark.parametrize(
    ("y", "eta"), [([-0.1, 0.02, 0.0], 0.0), ([0.1, 0.1, 0.0], 0.1), ([0.5, 0.0, 0.1], 0.3)]
)
def test_an_open_path_ends_where_it_ends(y, eta):
    place = NearestProjection(LINE)
    theta, found, position = place.function(y, place.nearest(y), 0)
    assert float(found) == pytest.approx(eta, abs=1e-9)
    np.testing.assert_allclose(np.array(position).ravel(), [eta, 0.0, 0.0], atol=1e-9)
    assert 0.0 <= float(theta) - LINE.position.domain[0] <= LINE.position.period


def test_revolutions_of_a_closed_path_are_counted():
    """Two and a half revolutions of a circle."""
    place = NearestProjection(CIRCLE)
    angle = np.linspace(0.0, 5.0 * math.pi, 2000)
    theta = float(place.nearest([0.12, 0.0, 0.0]))
    for tick, a in enumerate(angle):
        y = [0.12 * math.cos(a), 0.12 * math.sin(a), 0.0]
        theta, eta, _ = (np.array(x).ravel() for x in place.function(y, theta, tick))
    assert float(eta[0]) == pytest.approx(0.1 * 5.0 * math.pi, abs=1e-9)


def test_where_the_point_is_not_known_there_is_no_distance():
    way = np.array([[0.1, 0.05, 0.0], [np.nan] * 3, [0.1, 0.05, 0.0]])
    np.testing.assert_allclose(
        NearestProjection(LINE).distances(way), [0.05, np.nan, 0.05], atol=1e-9
    )
