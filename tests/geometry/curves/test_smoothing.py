"""How strongly points are smoothed."""

import numpy as np
import pytest

from pfsc_drake.geometry.curves.smoothing import SmoothFit, noise_level, smoothest_within

THETA = np.linspace(0.0, 3.0, 400)
TRUTH = np.stack([np.sin(2.0 * THETA), np.cos(3.0 * THETA)], axis=1)


def _smooth(points: np.ndarray, tolerance: float, noise: float) -> SmoothFit:
    return smoothest_within(
        THETA,
        points,
        3.0,
        degree=4,
        closed=False,
        tolerance=tolerance,
        noise=noise,
        deviation=lambda values: np.linalg.norm(values - points, axis=1),
    )


def _bends(fit: SmoothFit) -> float:
    theta = np.linspace(0.0, 3.0, 5000)
    return float(np.mean(np.sum(fit.curve.derivatives(theta, 3)[:, 3] ** 2, axis=1)))


@pytest.mark.parametrize("size", [0.0, 1e-4, 1e-2])
def test_noise_is_measured(size: float) -> None:
    rng = np.random.default_rng(0)
    noise = size * rng.normal(size=TRUTH.shape)
    expected = np.sqrt(2.0) * size
    found = noise_level(THETA, TRUTH + noise, across=False)
    assert found == pytest.approx(expected, rel=0.1, abs=1e-6)
    # of two directions one is along the curve
    found = noise_level(THETA, TRUTH + noise, across=True)
    assert found == pytest.approx(size, rel=0.15, abs=1e-6)


def test_noise_is_measured_at_uneven_parameters() -> None:
    rng = np.random.default_rng(1)
    theta = np.sort(rng.uniform(0.0, 3.0, 400))
    points = np.stack([np.sin(2.0 * theta), np.cos(3.0 * theta)], axis=1)
    assert noise_level(theta, points, across=False) < 1e-5
    points = points + 1e-3 * rng.normal(size=points.shape)
    assert noise_level(theta, points, across=False) == pytest.approx(np.sqrt(2.0) * 1e-3, rel=0.1)


def test_a_larger_tolerance_bends_less() -> None:
    fits = [_smooth(TRUTH, tolerance, 0.0) for tolerance in (1e-3, 1e-2, 1e-1)]
    for fit, tolerance in zip(fits, (1e-3, 1e-2, 1e-1), strict=True):
        # it is used up, not only kept
        assert 0.3 * tolerance < fit.deviations.max() <= tolerance
    bends = [_bends(fit) for fit in fits]
    assert bends[0] > bends[1] > bends[2]
    pieces = [len(fit.curve.breakpoints) for fit in fits]
    assert pieces[0] >= pieces[1] >= pieces[2]


def test_a_straight_line_stays_straight() -> None:
    rng = np.random.default_rng(2)
    line = np.stack([THETA, 2.0 * THETA], axis=1)
    fit = _smooth(line + 1e-3 * rng.normal(size=line.shape), 5e-3, 1.4e-3)
    second = fit.curve.derivatives(np.linspace(0.0, 3.0, 1000), 2)[:, 2]
    assert np.abs(second).max() < 2e-3


def test_one_point_far_off_is_reached_and_moves_no_others() -> None:
    rng = np.random.default_rng(3)
    points = TRUTH + 1e-3 * rng.uniform(-1.0, 1.0, TRUTH.shape)
    points[200] += [0.012, 0.0]
    fit = _smooth(points, 8e-3, 1e-3)
    assert fit.deviations.max() <= 8e-3
    assert fit.attainable > 8e-3
    values = fit.curve.derivatives(THETA, 0)[:, 0]
    assert np.abs(values[200] - TRUTH[200]).max() > 3e-3
    near = np.abs(THETA - THETA[200]) > 0.4
    assert np.linalg.norm(values - TRUTH, axis=1)[near].max() < 3e-3


@pytest.mark.slow
def test_what_cannot_be_reached_says_what_can() -> None:
    points = TRUTH + 0.05 * (np.arange(400) % 2)[:, None]
    parameters = THETA.copy()
    parameters[200] = parameters[201]  # two places at one parameter
    fit = smoothest_within(
        parameters,
        points,
        3.0,
        degree=4,
        closed=False,
        tolerance=1e-3,
        noise=0.05 / np.sqrt(2.0),
        deviation=lambda values: np.linalg.norm(values - points, axis=1),
    )
    assert fit.deviations.max() > 1e-3
    # the middle between even and odd points, less closely at the ends
    assert 0.05 / np.sqrt(2.0) < fit.attainable < 0.05
