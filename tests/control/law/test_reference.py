"""Motions that come to rest at several points."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from pfsc_drake.control.law.reference import rest_to_rest, straight_lines, together
from pfsc_drake.errors import InputError

VELOCITY, ACCELERATION = 0.8, 3.0


def sample(curve, order, count=4001):
    """Return times and derivatives 0..order, shape (count, order + 1)."""
    times = np.linspace(*curve.domain, count)
    return times, curve.derivatives(times, order)[..., 0]


@pytest.fixture(name="tour")
def fixture_tour():
    """There and back with a long, a short and a very short move."""
    points = [0.2, 1.5, 1.3, 1.3, 1.2, 1.2001, -0.4]
    return points, rest_to_rest(points, velocity=VELOCITY, acceleration=ACCELERATION, dwell=0.25)


def test_four_derivatives_are_continuous_everywhere(tour):
    """Jumps at the junctions against the largest value of the derivative on the neighbours."""
    _, curve = tour
    ends = curve.breakpoints
    for before, junction, after in zip(ends, ends[1:], ends[2:], strict=False):
        shorter = min(junction - before, after - junction)
        inside = np.linspace(before, after, 401)
        sizes = np.abs(curve.derivatives(inside, 4)[..., 0]).max(axis=0)
        step = 1e-9 * shorter
        left, right = curve.derivatives([junction - step, junction + step], 4)[..., 0]
        assert np.all(np.abs(right - left) <= 1e-6 * sizes + 1e-12), junction


def test_it_is_smooth_enough_for_the_elastic_law(tour):
    assert tour[1].smoothness >= 4


def test_limits_hold_and_are_reached():
    curve = rest_to_rest([0.0, 2.0], velocity=VELOCITY, acceleration=ACCELERATION)
    _, y = sample(curve, 2)
    assert np.abs(y[:, 1]).max() == pytest.approx(VELOCITY, rel=1e-9)
    assert np.abs(y[:, 2]).max() == pytest.approx(ACCELERATION, rel=1e-5)


def test_a_short_move_reaches_the_acceleration_only():
    curve = rest_to_rest([0.0, -0.01], velocity=VELOCITY, acceleration=ACCELERATION)
    _, y = sample(curve, 2)
    assert np.abs(y[:, 1]).max() < 0.5 * VELOCITY
    assert np.abs(y[:, 2]).max() == pytest.approx(ACCELERATION, rel=1e-5)
    assert y[-1, 0] == pytest.approx(-0.01, abs=1e-15)


def test_every_point_is_visited_at_rest(tour):
    points, curve = tour
    _, y = sample(curve, 4)
    at_rest = np.all(np.abs(y[:, 1:]) < 1e-9, axis=1)
    for point in points:
        assert np.any(at_rest & (np.abs(y[:, 0] - point) < 1e-12)), point
    assert y[0, 0] == points[0]
    assert y[-1, 0] == pytest.approx(points[-1], abs=1e-13)
    assert np.abs(y[:, 1]).max() <= VELOCITY * (1 + 1e-9)
    assert np.abs(y[:, 2]).max() <= ACCELERATION * (1 + 1e-9)


def test_dwell_lasts_as_long_as_asked():
    curve = rest_to_rest([1.0, 2.0], velocity=1.0, acceleration=2.0, dwell=0.5)
    begin, end = curve.domain
    assert begin == 0.0
    for times in (np.linspace(0.0, 0.5, 20), np.linspace(end - 0.5, end, 20)):
        derivatives = curve.derivatives(times, 1)[..., 0]
        assert np.abs(derivatives[:, 1]).max() < 1e-12
    assert curve.derivatives(0.55, 1)[1, 0] > 0.0
    assert curve.derivatives(end - 0.55, 1)[1, 0] > 0.0


def test_position_is_the_integral_of_the_velocity(tour):
    points, curve = tour

    def speed(t):
        return curve.derivatives(t, 1)[1, 0]

    for end in (0.6, 1.7, 2.9, curve.domain[1]):
        pieces = [0.0, *(b for b in curve.breakpoints if 0.0 < b < end), end]
        travelled = sum(quad(speed, a, b, epsabs=1e-12)[0] for a, b in pairwise(pieces))
        assert points[0] + travelled == pytest.approx(curve.derivatives(end, 0)[0, 0], abs=1e-11)


@settings(deadline=None)
@given(
    st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=4),
    st.floats(0.1, 3.0),
    st.floats(0.1, 5.0),
)
def test_moves_of_any_length_keep_the_limits(distances, velocity, acceleration):
    distances = [0.01 + d if abs(d) < 1e-3 else d for d in distances]
    points = np.cumsum([0.0, *distances]).tolist()
    curve = rest_to_rest(points, velocity=velocity, acceleration=acceleration)
    _, y = sample(curve, 2, 501)
    assert y[-1, 0] == pytest.approx(points[-1], abs=1e-12)
    assert np.abs(y[:, 1]).max() <= velocity * (1 + 1e-8)
    assert np.abs(y[:, 2]).max() <= acceleration * (1 + 1e-8)


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
@pytest.mark.parametrize("name", ["velocity", "acceleration"])
def test_limits_must_be_positive(name, bad):
    limits = {"velocity": 1.0, "acceleration": 1.0} | {name: bad}
    with pytest.raises(InputError, match=f"reference {name}: {bad}"):
        rest_to_rest([0.0, 1.0], **limits)


@pytest.mark.parametrize("dwell", [-0.1, np.nan])
def test_dwell_must_not_be_negative(dwell):
    with pytest.raises(InputError, match="reference dwell"):
        rest_to_rest([0.0, 1.0], velocity=1.0, acceleration=1.0, dwell=dwell)


@pytest.mark.parametrize("points", [[], [1.0], [0.0, np.nan], [0.3, 0.3]])
def test_points_must_be_two_different_numbers(points):
    with pytest.raises(InputError, match="reference points"):
        rest_to_rest(points, velocity=1.0, acceleration=1.0)


def test_no_part_is_too_short_for_its_time_to_be_told():
    with pytest.raises(InputError, match=r"reference: .* takes 2.19e-12 s from t = 1e\+06 s on"):
        rest_to_rest([0.0, 1.0], velocity=1e-6, acceleration=1e6, dwell=1e6)


PLACES = [[0.0, 0.0], [0.25, 0.0], [0.25, 0.15], [0.05, 0.05], [0.05, 0.05], [0.0, 0.0]]


@pytest.fixture(name="lines")
def fixture_lines():
    return straight_lines(PLACES, VELOCITY, ACCELERATION, 0.1)


def test_straight_lines_visit_all_places_at_rest(lines):
    times = np.linspace(*lines.domain, 20001)
    position, speed = np.moveaxis(lines.derivatives(times, 1), 1, 0)
    resting = np.abs(speed).max(axis=1) < 1e-9
    visited = position[resting]
    for place in PLACES:
        assert np.linalg.norm(visited - place, axis=1).min() < 1e-9
    assert np.array_equal(position[0], PLACES[0])
    assert np.allclose(position[-1], PLACES[-1], atol=1e-12)


def test_straight_lines_keep_the_limits_in_every_coordinate_and_are_straight(lines):
    times = np.linspace(*lines.domain, 20001)
    _, speed, acceleration = np.moveaxis(lines.derivatives(times, 2), 1, 0)
    assert np.abs(speed).max() == pytest.approx(VELOCITY, rel=1e-3) or (
        np.abs(speed).max() < VELOCITY
    )
    assert np.abs(acceleration).max() <= ACCELERATION * (1.0 + 1e-9)
    # on the way to the fourth place both move, in proportion
    both = (np.abs(speed) > 1e-6).all(axis=1)
    slope = speed[both][:, 1] / speed[both][:, 0]
    expected = {round(0.1 / 0.2, 6), 1.0}
    assert {round(float(s), 6) for s in slope} == expected
    assert lines.smoothness >= 4


def test_motions_together_are_each_its_own():
    first = ([0.0, 0.3, -0.25], 1.5, 6.0, 0.5)
    second = ([0.0, 0.2, -0.2], 1.0, 6.0, 0.5)
    both = together(first, second)
    alone = [
        rest_to_rest(points, velocity=v, acceleration=a, dwell=dwell)
        for points, v, a, dwell in (first, second)
    ]
    assert both.domain[1] == pytest.approx(max(motion.domain[1] for motion in alone), rel=1e-12)
    times = np.linspace(*both.domain, 3001)
    for k, motion in enumerate(alone):
        inside = times <= motion.domain[1]
        expected = motion.derivatives(times[inside], 4)[:, :, 0]
        actual = both.derivatives(times, 4)[:, :, k]
        scale = np.abs(expected).max(axis=0)
        assert np.all(np.abs(actual[inside] - expected) <= 1e-9 * scale)
        assert np.allclose(actual[~inside][:, 0], motion.derivatives([motion.domain[1]], 0)[0, 0])
        assert not actual[~inside][:, 1:].any()


@pytest.mark.parametrize("places", [[[0.0, 0.0]], [[0.0, 0.0], [1.0]], [[0.0, 0.0], [np.nan, 1.0]]])
def test_places_that_are_none_are_refused(places):
    with pytest.raises(InputError, match="reference places"):
        straight_lines(places, VELOCITY, ACCELERATION)
