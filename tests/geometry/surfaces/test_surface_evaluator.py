"""The surface's point tick by tick: closest points, lengths, revolutions, borders, bad input."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    FourierCurve,
    ProjectionStatus,
    SurfaceEvaluator,
    Turned,
    cylinder,
    extruded_surface,
    interpolate,
    paraboloid,
    plane,
    sphere,
    torus,
    translated_surface,
    zyx_to_matrix,
)

ORIGIN = np.array([0.3, -0.2, 0.7])
R = zyx_to_matrix([0.4, -0.7, 1.1])
TURNED = Turned(ORIGIN, R)
C = 1.667


def _follow(evaluator, points, eta=(0.0, 0.0)):
    """Points of the surface, tick by tick."""
    theta, rows = evaluator.project_globally(points[0]).theta, []
    for point in points:
        rows.append(evaluator(list(point), theta, eta))
        theta, eta = rows[-1][:2].tolist(), rows[-1][2:4].tolist()
    return np.array(rows)


def _above(surface, theta, height):
    position, first, second = np.moveaxis(surface.partials(theta, 1), -2, 0)
    normal = np.cross(first, second)
    return position + height * normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def _wave(axis):
    points = np.zeros((9, 3))
    points[:, axis] = np.linspace(-0.4, 0.4, 9)
    points[:, 2] = 0.02 * np.sin(9.0 * points[:, axis])
    return interpolate(points, smoothness=5)


CASES = {
    "splines": (translated_surface(_wave(0), _wave(1)), (0.4, 0.4), (0.35, 0.3)),
    "cylinder": (cylinder(0.09, (-0.2, 0.2), TURNED), (0.0, 0.0), (3.0, 0.15)),
    "sphere": (sphere(0.2, (-1.4, 1.4), TURNED), (0.0, 0.0), (2.0, 1.0)),
    "torus": (torus(0.5, 0.1, TURNED), (0.0, 0.0), (2.0, 4.0)),
    "paraboloid": (paraboloid(((-0.3, 0.3), (-0.3, 0.3)), C), (0.0, 0.0), (0.25, 0.28)),
    "plane": (plane((1.0, 2.0), ORIGIN, R), (0.5, 1.0), (0.4, 0.9)),
}


@pytest.mark.slow(
    but=[
        "splines-0.02",
        "cylinder-0.0",
        "sphere-0.02",
        "torus--0.03",
        "torus-0.02",
        "paraboloid--0.03",
        "plane-0.0",
    ]
)
@pytest.mark.parametrize("height", [-0.03, 0.0, 0.02])
@pytest.mark.parametrize("name", CASES)
def test_a_motion_beside_the_surface(name, height):
    """Closest points and partial derivatives at each tick; eta against an independent integral."""
    surface, middle, reach = CASES[name]
    evaluator = SurfaceEvaluator(surface, 4)
    s = np.linspace(0.0, 2.5, 400)
    theta = np.array(middle) + np.array(reach) * np.column_stack([np.sin(s), np.sin(1.7 * s)])
    rows = _follow(evaluator, _above(surface, theta, height))
    layout = evaluator.layout
    wrapped = theta + np.round((rows[0, :2] - theta[0]) / (2 * math.pi)) * 2 * math.pi
    np.testing.assert_allclose(rows[:, layout.theta], wrapped, atol=1e-11)
    assert np.all(rows[:, layout.status] == ProjectionStatus.OK)
    partials = surface.partials(theta, 5).reshape(len(s), -1)
    scale = np.abs(partials).max(axis=0)
    assert np.all(np.abs(rows[:, layout.position] - partials) <= 1e-10 * (1.0 + scale))

    def sigma(time, _):
        place = np.array(middle) + np.array(reach) * [math.sin(time), math.sin(1.7 * time)]
        _, first, second = surface.partials(place, 1)
        rate = np.array(reach) * [math.cos(time), 1.7 * math.cos(1.7 * time)]
        e_1 = first / np.linalg.norm(first)
        e_2 = second - (second @ e_1) * e_1
        e_2 /= np.linalg.norm(e_2)
        motion = rate[0] * first + rate[1] * second
        return [e_1 @ motion, e_2 @ motion]

    exact = solve_ivp(sigma, (0.0, 2.5), [0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-13)
    # What is left is that ticks go straight in the parameters.
    np.testing.assert_allclose(rows[-1, layout.eta], exact.y[:, -1], atol=2e-5)


def test_eta_is_of_fourth_order_on_a_straight_line_of_parameters():
    surface = paraboloid(((-0.3, 0.3), (-0.3, 0.3)), C)
    evaluator = SurfaceEvaluator(surface, 2)
    begin, end = np.array([-0.2, -0.25]), np.array([0.2, 0.15])
    errors, exact = [], None
    for ticks in (1600, 100, 50):
        s = np.linspace(0.0, 1.0, ticks + 1)[:, None]
        eta = _follow(evaluator, _above(surface, begin + s * (end - begin), 0.01))[-1, 2:4]
        exact = eta if exact is None else exact
        errors.append(np.abs(eta - exact).max())
    assert errors[1] < 2e-9
    assert errors[2] / errors[1] == pytest.approx(16.0, rel=0.2)


@pytest.mark.slow
def test_eta_returns_on_a_cylinder():
    """Over a closed curve without a revolution, and by the circumference over each revolution."""
    evaluator = SurfaceEvaluator(cylinder(0.09, (-0.2, 0.2), TURNED), 2)
    s = np.linspace(0.0, 2.0 * math.pi, 1001)
    theta = np.column_stack([1.0 + 1.5 * np.cos(s), 0.1 * np.sin(s)])
    rows = _follow(evaluator, _above(evaluator.surface, theta, 0.01))
    np.testing.assert_allclose(rows[-1, 2:4], 0.0, atol=1e-12)
    revolutions = 40
    s = np.linspace(0.0, 2.0 * math.pi * revolutions, 1000 * revolutions)
    theta = np.column_stack([1.0 + s, 0.1 * np.sin(s)])
    rows = _follow(evaluator, _above(evaluator.surface, theta, -0.02))
    np.testing.assert_allclose(rows[-1, :2], [1.0 + 2.0 * math.pi * revolutions, 0.0], atol=1e-11)
    np.testing.assert_allclose(rows[-1, 2:4], [0.09 * 2.0 * math.pi * revolutions, 0.0], atol=1e-9)


def test_holonomy_on_the_paraboloid():
    """Eta does not return: its change is an integral over the area that is gone round.

    On theta = rho (cos s, sin s) both components vanish by symmetry, so the circle stands beside
    the vertex. Green: the integral of d Sigma_12 / d theta_1 - d Sigma_11 / d theta_2.
    """
    surface = paraboloid(((-0.3, 0.3), (-0.3, 0.3)), C)
    evaluator = SurfaceEvaluator(surface, 2)
    middle, radius = np.array([0.1, 0.12]), 0.12
    s = np.linspace(0.0, 2.0 * math.pi, 4001)
    theta = middle + radius * np.column_stack([np.cos(s), np.sin(s)])
    eta = _follow(evaluator, _above(surface, theta, 0.01))[-1, 2:4]
    nodes, weights = np.polynomial.legendre.leggauss(40)
    rho, shares = 0.5 * radius * (nodes + 1.0), 0.5 * radius * weights
    angle = 2.0 * math.pi * np.arange(80) / 80
    u = middle[0] + rho[:, None] * np.cos(angle)
    v = middle[1] + rho[:, None] * np.sin(angle)
    E, four = 1.0 + 4.0 * C**2 * u**2, 4.0 * C**2
    W = 1.0 + four * (u**2 + v**2)
    # Sigma_11 = sqrt(E), Sigma_12 = 4 c^2 u v / sqrt(E), Sigma_22 = sqrt(W / E).
    first = four * v / E**1.5
    second = four * u * (1.0 / np.sqrt(W * E) - np.sqrt(W) / E**1.5)
    area = shares * rho * 2.0 * math.pi / 80
    expected = [area @ first.sum(axis=1), area @ second.sum(axis=1)]
    # The polygon of ticks covers a little less than the circle.
    np.testing.assert_allclose(eta, expected, rtol=2e-6)
    assert abs(expected[0]) > 1e-2


def test_alpha_is_the_distance_over_the_radius_of_curvature():
    evaluator = SurfaceEvaluator(paraboloid(((-0.3, 0.3), (-0.3, 0.3)), C), 2)
    for height, expected in [(0.1, 0.2 * C), (-0.1, -0.2 * C), (0.0, 0.0)]:
        row = evaluator([0.0, 0.0, height], (0.01, -0.01), (0.0, 0.0))
        assert row[4] == pytest.approx(expected, abs=1e-12)


def test_at_the_centre_of_curvature():
    evaluator = SurfaceEvaluator(cylinder(0.09, (-0.1, 0.1)), 2)
    row = evaluator([0.0, 0.0, 0.05], (1.0, 0.05), (0.0, 0.0))
    assert row[4] == pytest.approx(1.0, abs=1e-14)
    assert row[:2] == pytest.approx([1.0, 0.05])
    assert np.all(np.isfinite(row))


def test_border_and_back():
    """Beyond a border the surface goes on; where it ends the other parameter goes on alone."""
    evaluator = SurfaceEvaluator(cylinder(0.09, (-0.1, 0.1)), 3)
    s = np.linspace(0.0, math.pi, 500)
    height, angle = 0.18 * np.sin(s), 1.2 * s / math.pi
    points = np.column_stack([0.1 * np.cos(angle), 0.1 * np.sin(angle), height])
    rows = _follow(evaluator, points)
    beyond = height > 0.1 + 1e-9
    assert np.all(np.isfinite(rows))
    assert np.array_equal(rows[:, 5] == ProjectionStatus.BEYOND_END, beyond)
    np.testing.assert_allclose(rows[:, 0], angle, atol=1e-11)
    np.testing.assert_allclose(rows[:, 1], np.minimum(height, 0.15), atol=1e-12)
    np.testing.assert_allclose(rows[:, 2], 0.09 * angle, atol=1e-12)
    np.testing.assert_allclose(rows[:, 3], np.minimum(height, 0.15), atol=1e-12)


def test_a_far_guess_finds_the_closest_point():
    evaluator = SurfaceEvaluator(torus(0.5, 0.1), 2)
    point = _above(evaluator.surface, np.array([0.5, 1.0]), 0.02)
    for guess in [(3.0, 4.0), (6.5, 7.0), (0.5, -2.2), (40.0, 1.0)]:
        row = evaluator(point.tolist(), guess, (0.0, 0.0))
        assert row[5] == ProjectionStatus.OK
        off = (row[:2] - [0.5, 1.0]) / (2.0 * math.pi)
        np.testing.assert_allclose(off, np.round(off), atol=1e-12)
        assert np.all(np.abs(row[:2] - guess) <= math.pi + 1e-9)


@pytest.mark.slow
def test_through_a_crossing():
    eight = FourierCurve([0, 0, 0], [[0.2, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0.1, 0]])
    evaluator = SurfaceEvaluator(extruded_surface(eight, (0.0, 0.0, 1.0), 0.3), 2)
    theta = np.column_stack([np.linspace(0.3, 12.0, 4000), np.full(4000, 0.1)])
    rows = _follow(evaluator, _above(evaluator.surface, theta, 0.005))
    np.testing.assert_allclose(rows[:, :2], theta, atol=1e-11)


def test_without_memory():
    evaluator = SurfaceEvaluator(torus(0.5, 0.1), 4)
    arguments = ([0.61, 0.02, 0.03], (0.01, 0.3), (0.4, 0.5))
    first = evaluator(*arguments)
    evaluator([0.0, 0.61, 0.03], (1.5, 0.3), (0.4, 0.5))
    second = evaluator(*arguments)
    assert np.array_equal(first, second)
    assert first is not second


@pytest.fixture(name="oriented", scope="module")
def fixture_oriented():
    return SurfaceEvaluator(cylinder(0.09, (-0.1, 0.1)), 2, orientation=[1, 0, 0, 0])


@pytest.mark.parametrize("bad", [math.nan, math.inf, 1e200])
@pytest.mark.parametrize("where", range(7))
def test_input_that_is_not_finite(oriented, bad, where):
    values = [0.1, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0]
    values[where] = bad
    row = oriented(values[:3], values[3:5], values[5:])
    if bad == 1e200 and np.all(np.isfinite(row)):
        return
    assert row[5] == ProjectionStatus.NOT_CONVERGED
    assert np.all(np.isnan(np.delete(row, 5)))


def test_evaluate_at_and_orientation():
    surface = sphere(0.2, (-1.4, 1.4))
    evaluator = SurfaceEvaluator(surface, 3, orientation=[0.6, 0.8, 0.0, 0.0])
    row = evaluator.evaluate_at((0.3, 0.4), (1.0, 2.0))
    assert row[:6].tolist() == [0.3, 0.4, 1.0, 2.0, 0.0, ProjectionStatus.OK]
    layout = evaluator.layout
    np.testing.assert_allclose(
        row[layout.position], surface.partials([0.3, 0.4], 4).ravel(), atol=1e-14
    )
    assert row[layout.quaternion].tolist() == [0.6, 0.8] + [0.0] * 38
    with pytest.raises(InputError, match=r"theta_2: 1\.5"):
        evaluator.evaluate_at((0.0, 1.5))
    with pytest.raises(InputError, match="theta_1: nan"):
        evaluator.evaluate_at((math.nan, 0.5))


def test_what_it_cannot_be_made_of():
    profile = interpolate(
        np.random.default_rng(1).normal(size=(8, 3)) * 0.01 + np.arange(8)[:, None] * [0.1, 0, 0],
        smoothness=3,
    )
    surface = extruded_surface(profile, (0.0, 0.0, 1.0), 1.0)
    SurfaceEvaluator(surface, 2)
    with pytest.raises(InputError, match=r"class C\^3; C\^4 or smoother is required"):
        SurfaceEvaluator(surface, 3)
    with pytest.raises(InputError, match="surface orientation"):
        SurfaceEvaluator(surface, 2, orientation=[0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("revolution", [-2, 0, 3])
@pytest.mark.parametrize("guess", [2.0, -2.0])
def test_a_far_jump_finds_the_nearest_sheet_in_the_period_of_the_guess(guess, revolution):
    """Within an elliptic tube the descent from the guess leads to the farther of two minima."""
    ellipse = FourierCurve([0, 0, 0], [[0.1, 0, 0]], [[0, 0.14, 0]])
    evaluator = SurfaceEvaluator(extruded_surface(ellipse, (0.0, 0.0, 1.0), 0.3), 2)
    turns = 2.0 * math.pi * revolution
    row = evaluator([0.01, 0.0, 0.1], (turns + guess, 0.1), (0.0, 0.0))
    assert row[5] == ProjectionStatus.OK
    np.testing.assert_allclose(row[:2], [turns, 0.1], atol=1e-9)


def test_beyond_both_centres_of_curvature_no_maximum_is_taken():
    """In a sphere, past its centre: f has a maximum at the guess; the closest point is opposite."""
    surface = sphere(0.2, (-1.4, 1.4), TURNED)
    theta = np.array([0.3, 0.2])
    point = ORIGIN + 0.25 * (surface.partials(theta, 0)[0] - ORIGIN)
    row = SurfaceEvaluator(surface, 2)(
        point.tolist(), (theta[0] + math.pi + 0.01, -theta[1] + 0.01), (0.0, 0.0)
    )
    np.testing.assert_allclose(row[6:9], surface.partials(theta, 0)[0], atol=1e-12)
    assert row[4] == pytest.approx(0.75)


def test_eta_over_a_far_jump():
    """The integral of Sigma along the straight line of the parameters, by other quadrature."""
    surface = CASES["paraboloid"][0]
    begin, end = np.array([-0.28, -0.2]), np.array([0.25, 0.27])
    point = _above(surface, end, 0.01)
    row = SurfaceEvaluator(surface, 2)(point.tolist(), begin.tolist(), (0.1, 0.2))
    np.testing.assert_allclose(row[:2], end, atol=1e-11)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    places = begin + (nodes[:, None] + 1.0) / 2.0 * (end - begin)
    _, first, second = np.moveaxis(surface.partials(places, 1), -2, 0)
    E, F, G = ((a * b).sum(axis=-1) for a, b in ((first, first), (first, second), (second, second)))
    d1, d2 = end - begin
    lengths = [np.sqrt(E) * d1 + F / np.sqrt(E) * d2, np.sqrt(G - F**2 / E) * d2]
    expected = [0.1, 0.2] + np.array(lengths) @ weights / 2.0
    np.testing.assert_allclose(row[2:4], expected, atol=1e-6)


@pytest.mark.slow(but="cylinder")
@pytest.mark.parametrize("name", CASES)
def test_the_closest_point_of_all_is_found(name):
    surface = CASES[name][0]
    evaluator, ends = SurfaceEvaluator(surface, 1), np.array(surface.domain)
    along = [np.linspace(*own, 121) for own in ends]
    grid = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 2)
    samples = surface.partials(grid, 0)[:, 0]
    rng = np.random.default_rng(7)
    for _ in range(30):
        point = rng.choice(samples) + rng.normal(size=3) * rng.choice([1e-3, 0.03])
        memory = np.array(evaluator.find(point)).ravel()
        row = evaluator(point.tolist(), memory[:2], memory[2:])
        least = np.linalg.norm(samples - point, axis=1).min()
        assert np.linalg.norm(row[6:9] - point) < least + 1e-9
        assert memory[2:].tolist() == [0.0, 0.0]
        if row[5] == ProjectionStatus.OK:
            assert np.all((ends[:, 0] <= memory[:2]) & (memory[:2] <= ends[:, 1]))
