"""Projection: constructed closest points, dense samples, revolutions, crossings, ends."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pfsc_drake.geometry import (
    FourierCurve,
    PiecewisePolynomialCurve,
    interpolate,
)
from pfsc_drake.geometry.curves.curve import Curve
from tests.geometry.paths.newton_projector import Projector

LEMNISCATE = FourierCurve.bent_lemniscate()
COORDINATE = st.floats(-0.5, 0.5)


def _spline(seed: int, closed: bool = False) -> PiecewisePolynomialCurve:
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 5.5, 10)
    points = np.stack([np.cos(angle), np.sin(angle), 0.1 * angle], axis=1)
    return interpolate(points + 0.1 * rng.normal(size=points.shape), smoothness=3, closed=closed)


def _beside(curve: Curve, theta: float, distance: float, angle: float) -> np.ndarray:
    """Point whose projection is theta by construction: off the curve across its tangent."""
    sigma, first = curve.derivatives(theta, 1)
    tangent = first / np.linalg.norm(first)
    u = np.cross(tangent, [0.3, -0.5, 0.8])
    u /= np.linalg.norm(u)
    v = np.cross(tangent, u)
    return sigma + distance * (math.cos(angle) * u + math.sin(angle) * v)


@given(
    theta=st.floats(-20.0, 20.0),
    distance=st.floats(0.0, 0.02),
    angle=st.floats(0.0, 6.3),
    offset=st.floats(-0.05, 0.05),
)
@settings(max_examples=150, deadline=None)
def test_warm_start_finds_the_constructed_closest_point(
    theta: float, distance: float, angle: float, offset: float
) -> None:
    point = _beside(LEMNISCATE, theta, distance, angle)
    result = Projector(LEMNISCATE).project(point.tolist(), theta + offset)
    assert result.converged
    assert not result.at_end
    assert result.theta == pytest.approx(theta, abs=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_tracks_revolutions_and_the_crossing_without_changing_the_branch(direction: float) -> None:
    projector = Projector(LEMNISCATE)
    theta = 0.3
    for step in range(1, 3000):
        truth = 0.3 + direction * 3 * 2 * math.pi * step / 3000
        point = _beside(LEMNISCATE, truth, 0.01, 0.02 * step)
        theta = projector.project(point.tolist(), theta).theta
        assert theta == pytest.approx(truth, abs=1e-10)
    assert abs(theta) > 18.0


def test_crossing_itself_belongs_to_two_branches() -> None:
    crossing = LEMNISCATE.derivatives(math.pi / 2, 0)[0].tolist()
    projector = Projector(LEMNISCATE)
    assert projector.project(crossing, 1.5).theta == pytest.approx(math.pi / 2, abs=1e-12)
    assert projector.project(crossing, 4.8).theta == pytest.approx(1.5 * math.pi, abs=1e-12)


def test_far_guess_descends_to_a_minimum() -> None:
    projector = Projector(LEMNISCATE)
    rng = np.random.default_rng(4)
    for _ in range(200):
        point = LEMNISCATE.derivatives(rng.uniform(0, 6.28), 0)[0] + 0.2 * rng.normal(size=3)
        guess = rng.uniform(-10, 10)
        result = projector.project(point.tolist(), guess)
        sigma, first, _ = LEMNISCATE.derivatives(result.theta, 2)
        before = np.linalg.norm(point - LEMNISCATE.derivatives(guess, 0)[0])
        assert result.converged
        assert result.alpha < 1.0
        assert abs((point - sigma) @ first) < 1e-11
        assert np.linalg.norm(point - sigma) <= before + 1e-12


def test_long_steps_do_not_skip_revolutions() -> None:
    # J'' is nearly zero at the guess: a full step of Newton's method is 5e5 rad long.
    circle = FourierCurve.circle([0, 0, 0], 1.0)
    for revolution in (-1, 0, 2):
        guess = math.pi / 2 - 2e-6 + 2 * math.pi * revolution
        result = Projector(circle).project([0.5, 0.0, 0.0], guess)
        assert result.theta == pytest.approx(2 * math.pi * revolution, abs=1e-10)


@pytest.mark.slow(but="1")
@pytest.mark.parametrize("seed", range(4))
def test_distance_never_grows_on_a_winding_curve(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = np.cumsum(0.1 * rng.normal(size=(15, 3)) + [0.1, 0, 0], axis=0)
    curve = interpolate(points, smoothness=4)
    projector = Projector(curve)
    for _ in range(250):
        point = points.mean(axis=0) + 0.3 * rng.normal(size=3)
        guess = rng.uniform(*curve.domain)
        result = projector.project(point.tolist(), guess)
        reached = curve.derivatives([guess, result.theta], 0)[:, 0]
        before, after = np.linalg.norm(reached - point, axis=1)
        assert result.converged
        assert after <= before + 1e-12


def test_open_ends_clamp() -> None:
    line = PiecewisePolynomialCurve.line([0.0, 0.0, 0.0], [1.0, 0.0, 0.0])
    projector = Projector(line)
    inside = projector.project([0.9999, 0.1, 0.0], 0.2)
    assert (inside.at_end, inside.converged) == (False, True)
    assert inside.theta == pytest.approx(0.9999, abs=1e-14)
    beyond = projector.project([1.001, 0.1, 0.0], 0.2)
    assert beyond[0] == 1.0
    assert (beyond.at_end, beyond.converged) == (True, True)
    before = projector.project([-5.0, 0.1, 0.0], 0.2)
    assert (before.theta, before.at_end, before.converged) == (0.0, True, True)
    exactly = projector.project([1.0, 0.3, 0.0], 0.999)
    assert exactly.theta == pytest.approx(1.0, abs=1e-12)
    assert not exactly.at_end
    assert not projector.project([0.5, 0.0, 0.0], 1.0).at_end
    assert projector.project([0.5, 0.0, 0.0], 30.0).theta == pytest.approx(0.5, abs=1e-12)


def test_centre_of_a_circle_is_not_a_strict_minimum() -> None:
    result = Projector(FourierCurve.circle([0, 0, 0], 1.0)).project([0.0, 0.0, 0.0], 0.4)
    assert not result.converged
    assert result.alpha == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("centre", "beyond", "angle"),
    [
        ([-2.1390000529541577, 0.7008301371461622, 0.09631938828645387], 3.723607138829761e-07,
         2.6103183199737243),
        ([5.439234560342072, 2.0992735673252816, -13.029900141443427], 2.531541242187901e-09,
         2.86309806649092),
        ([2.580872003751626, -5.05491376376775, -5.837945308992216], 2.8610591008271826e-06,
         4.966457368696757),
    ],
)  # fmt: skip
@pytest.mark.parametrize("step", [0.0, 1e-13, -1e-12, 1e-11, -1e-9])
def test_no_stalled_maximum_counts_as_the_closest_point(
    centre: list[float], beyond: float, angle: float, step: float
) -> None:
    """Just beyond the centre of a circle, at its farthest point: steps end in rounding errors."""
    circle = FourierCurve.circle(centre, 1.0)
    direction = np.array([math.cos(angle), math.sin(angle), 0.0])
    point = (np.array(centre) - beyond * direction).tolist()
    result = Projector(circle).project(point, angle + step)
    assert not result.converged or result.alpha < 1.0


def test_a_step_that_overshoots_is_halved() -> None:
    """Between two bends full steps of Newton's method go to and fro for ever."""
    points = [
        [-0.11535051720022994, 0.012813117540587025, 0.02659754115572893],
        [0.11606088400600399, 0.05359802001989985, 0.050554667091403306],
        [0.17207247192249286, -0.07557246021442587, -0.08119978047538409],
        [0.22071125671825753, -0.17984778731589407, -0.20572198832362212],
        [0.2831490670874785, -0.16973587947805696, -0.2125305128172127],
        [0.23539170749444274, -0.32426069132120533, -0.22111818377081632],
        [0.269404085667612, -0.322610318635475, -0.1550582995045272],
        [0.49123447944386844, -0.2719930174950428, -0.06185399220643992],
        [0.45390586180028014, -0.25639284025481723, -0.2409150248025054],
        [0.480611618521719, -0.1856534164969723, -0.33608293420311974],
    ]
    point, guess = (
        [0.292585444369587, -0.25847094679877924, 0.04290028416161609],
        0.7078023964083564,
    )
    curve = interpolate(points, smoothness=3)
    result = Projector(curve).project(point, guess)
    assert result.converged
    assert result.iterations < 20
    sigma, slope = curve.derivatives(result.theta, 1)
    assert abs((np.array(point) - sigma) @ slope) < 1e-11
    before = np.linalg.norm(np.array(point) - curve.derivatives(guess, 0)[0])
    assert np.linalg.norm(np.array(point) - sigma) < before


def test_maximum_is_left() -> None:
    circle = FourierCurve.circle([0, 0, 0], 1.0)
    result = Projector(circle).project([0.5, 0.0, 0.0], math.pi - 0.01)
    assert result.converged
    assert result.theta == pytest.approx(0.0, abs=1e-11)


def test_other_dimensions() -> None:
    plane = FourierCurve([0.0, 0.0], [[2.0, 0.0]], [[0.0, 1.0]])
    result = Projector(plane).project([5.0, 0.0], 0.3)
    assert result.theta % (2 * math.pi) == pytest.approx(0.0, abs=1e-10)
    four = PiecewisePolynomialCurve.line([0, 0, 0, 0], [1, 1, 1, 1])
    assert Projector(four).project([1.0, 0, 0, 0], 0.1).theta == pytest.approx(0.5, abs=1e-12)


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_input_that_is_not_finite_does_not_raise(closed: bool, bad: float) -> None:
    curve = _spline(0, closed)
    projector = Projector(curve)
    assert not projector.project([0.0, bad, 0.0], 1.0).converged
    assert not projector.project([0.0, 0.0, 0.0], bad).converged
    assert not Projector(LEMNISCATE).project([0.0, 0.0, 0.0], bad).converged
