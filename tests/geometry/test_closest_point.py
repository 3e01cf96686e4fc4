"""The nearest point against closed forms and against a minimization by scipy."""

import math

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize

from pfsc_drake.geometry import closest_point
from pfsc_drake.geometry.closest_point import ClosestPointFinder

TURN = (0.0, 2.0 * math.pi)


def _finder(p, shape, domain, closed):
    """Function (y, guess) -> theta, distance, alpha, beyond_end, converged, known."""
    theta = ca.SX.sym("theta", p)
    sigma = shape(theta)
    columns, rows = [sigma], [ca.jacobian(sigma, theta[i]) for i in range(p)]
    columns += rows
    columns += [ca.jacobian(rows[i], theta[j]) for i in range(p) for j in range(i, p)]
    terms = ca.Function("terms", [theta], [ca.densify(ca.horzcat(*columns))])
    y, guess = ca.MX.sym("y", 3), ca.MX.sym("guess", p)
    found = ClosestPointFinder(terms, domain, closed, 1.0 / 16.0).find(y, guess)
    values = [found.theta, found.distance, found.alpha, found.beyond_end, found.converged]
    function = ca.Function("find", [y, guess], [*values, found.known])
    position = ca.Function("position", [theta], [sigma])

    def find(y, guess):
        theta, *rest = function(y, guess)
        return np.array(theta).ravel(), *(float(value) for value in rest)

    return find, lambda theta: np.array(position(theta)).ravel()


def _wave(theta):
    return ca.vertcat(theta, 0.3 * ca.sin(3.0 * theta), 0.2 * theta**2)


def _torus(theta):
    r = 1.0 + 0.3 * ca.cos(theta[1])
    return ca.vertcat(r * ca.cos(theta[0]), r * ca.sin(theta[0]), 0.3 * ca.sin(theta[1]))


def _saddle(theta):
    return ca.vertcat(theta[0], theta[1], 0.5 * (theta[0] ** 2 - theta[1] ** 2) + 0.1 * theta[0])


CURVE = _finder(1, _wave, [(-1.0, 1.0)], [False])
TORUS = _finder(2, _torus, [TURN, TURN], [True, True])
SADDLE = _finder(2, _saddle, [(-0.5, 0.5), (-0.4, 0.4)], [False, False])


def test_a_torus_has_a_closed_form() -> None:
    find, position = TORUS
    rng = np.random.default_rng(1)
    for _ in range(100):
        theta, height = rng.uniform(-9.0, 9.0, 2), rng.uniform(-0.2, 0.5)
        centre = np.array([math.cos(theta[0]), math.sin(theta[0]), 0.0])
        y = centre + (position(theta) - centre) * (1.0 + height / 0.3)
        found, distance, alpha, beyond_end, converged, known = find(y, theta + rng.normal() * 0.05)
        np.testing.assert_allclose(found, theta, atol=1e-11)
        assert distance == pytest.approx(abs(height), abs=1e-12)
        ring = -height * math.cos(theta[1]) / (1.0 + 0.3 * math.cos(theta[1]))
        assert alpha == pytest.approx(max(-height / 0.3, ring), abs=1e-9)
        assert (beyond_end, converged, known) == (0.0, 1.0, 1.0)


@pytest.mark.parametrize(
    ("result", "domain"),
    [(CURVE, [(-1.0, 1.0)]), (SADDLE, [(-0.5, 0.5), (-0.4, 0.4)])],
    ids=["curve", "saddle"],
)
def test_minima_with_ends(result, domain) -> None:
    """Strict minima in the domain, from near and from far, on the border and inside."""
    find, position = result
    low, high = np.array(domain).T
    rng = np.random.default_rng(2)
    inside = beyond = 0
    for _ in range(150):
        place = rng.uniform(1.3 * low, 1.3 * high)
        y = position(place) + 0.1 * rng.normal(size=3)
        guess = place + rng.choice([0.01, 0.3]) * rng.normal(size=len(low))
        theta, distance, _, beyond_end, converged, _ = find(y, guess)
        assert converged
        assert np.all((low <= theta) & (theta <= high))
        assert distance == pytest.approx(np.linalg.norm(y - position(theta)), abs=1e-14)
        near = minimize(
            lambda t, y=y: np.sum((y - position(t)) ** 2),
            theta,
            bounds=[
                (max(a, t - 0.02), min(b, t + 0.02))
                for a, b, t in zip(low, high, theta, strict=True)
            ],
            tol=1e-14,
        )
        assert distance <= math.sqrt(near.fun) + 1e-9
        at_border = bool(np.any((theta == low) | (theta == high)))
        assert bool(beyond_end) <= at_border
        inside, beyond = inside + (not at_border), beyond + bool(beyond_end)
    assert inside > 20
    assert beyond > 20


def test_a_guess_beyond_an_end_is_moved_there() -> None:
    find, position = CURVE
    theta, _, _, beyond_end, converged, _ = find(position(0.98), 7.0)
    assert theta[0] == pytest.approx(0.98, abs=1e-12)
    assert (beyond_end, converged) == (0.0, 1.0)


def test_the_axis_of_a_circle_has_no_minimum() -> None:
    find, _ = _finder(1, lambda t: ca.vertcat(ca.cos(t), ca.sin(t), 0.0), [TURN], [True])
    _, distance, alpha, _, converged, known = find([0.0, 0.0, 0.0], 0.4)
    assert (converged, known) == (0.0, 1.0)
    assert distance == pytest.approx(1.0, abs=1e-14)
    assert alpha == pytest.approx(1.0, abs=1e-14)


def test_a_saddle_of_the_distance_is_no_minimum() -> None:
    """Above z = x y by h the distance grows along x and y, and falls between them where h > 1."""
    domain = [(-1.0, 1.0), (-1.0, 1.0)]
    find, _ = _finder(2, lambda t: ca.vertcat(t, t[0] * t[1]), domain, [False, False])
    for height, is_minimum in ((0.9, 1.0), (1.1, 0.0)):
        theta, distance, alpha, _, converged, _ = find([0.0, 0.0, height], [0.0, 0.0])
        np.testing.assert_array_equal(theta, 0.0)
        assert (distance, alpha) == (pytest.approx(height), pytest.approx(height))
        assert converged == is_minimum


def test_a_maximum_along_an_end_is_no_minimum() -> None:
    """Beyond the end of a half pipe, the far side of its rim from a point beside the axis."""
    find, _ = _finder(
        2, lambda t: ca.vertcat(ca.cos(t[0]), ca.sin(t[0]), t[1]), [TURN, (0.0, 1.0)], [True, False]
    )
    for guess, is_minimum in ((0.0, 1.0), (math.pi, 0.0)):
        theta, *_, beyond_end, converged, _ = find([0.5, 0.0, 1.3], [guess, 1.0])
        np.testing.assert_allclose(theta, [guess, 1.0], atol=1e-15)
        assert (beyond_end, converged) == (1.0, is_minimum)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_nowhere(value: float) -> None:
    for (find, _), p in ((CURVE, 1), (TORUS, 2), (SADDLE, 2)):
        for y, guess in (([0.1, value, 0.0], 0.1), ([0.1, 0.0, 0.0], value)):
            *_, converged, known = find(y, [guess] * p)
            assert (converged, known) == (0.0, 0.0)


def test_it_ends_after_its_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(closest_point, "_MAX_STEPS", closest_point._TICK_STEPS)
    find, position = _finder(2, _torus, [TURN, TURN], [True, True])
    *_, converged, known = find(position([0.0, 0.0]), [2.0, 2.0])
    assert (converged, known) == (0.0, 1.0)
