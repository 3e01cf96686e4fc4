"""The way from the start to the reference."""

import numpy as np
import pytest

from pfsc_drake.control.law.reference import Transition
from pfsc_drake.errors import InputError

DURATION = 0.4


def at(transition, time):
    return transition.at(time).full().ravel()


def test_from_one_to_nothing_at_rest_at_both_ends():
    s = Transition(DURATION, 4)
    np.testing.assert_allclose(at(s, 0.0), [1, 0, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(at(s, DURATION), np.zeros(5), atol=1e-7)
    assert at(s, DURATION / 2)[0] == pytest.approx(0.5)
    np.testing.assert_array_equal(at(s, -1.0), at(s, 0.0))
    np.testing.assert_array_equal(at(s, 9.0), at(s, DURATION))


def test_falls_steadily():
    values = np.array([at(Transition(DURATION, 0), t)[0] for t in np.linspace(0, DURATION, 200)])
    assert np.all(np.diff(values) <= 0.0)


def test_derivatives_against_differences():
    s, h = Transition(DURATION, 4), 1e-5
    for t in np.linspace(0.02, 0.38, 7):
        slopes = (at(s, t + h) - at(s, t - h)) / (2.0 * h)
        np.testing.assert_allclose(at(s, t)[1:], slopes[:-1], rtol=1e-6, atol=1e-4)


def test_the_fourth_derivative_does_not_jump():
    s = Transition(DURATION, 4)
    largest = max(abs(at(s, t)[4]) for t in np.linspace(0, DURATION, 400))
    for end in (1e-6, DURATION - 1e-6):
        assert abs(at(s, end)[4]) < 1e-3 * largest


@pytest.mark.parametrize(("duration", "order"), [(0.0, 1), (-1.0, 1), (np.inf, 1), (1.0, 5)])
def test_what_is_refused(duration, order):
    with pytest.raises(InputError, match=r"^transition: "):
        Transition(duration, order)
