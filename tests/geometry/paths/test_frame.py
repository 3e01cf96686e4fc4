"""Parallel transport frame against double reflections, (3.4) and the total torsion."""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    FourierCurve,
    ParallelTransportFrame,
    PiecewisePolynomialCurve,
    interpolate,
)
from pfsc_drake.geometry.curves.curve import Curve


def _double_reflection(curve: Curve, normal: np.ndarray, thetas: np.ndarray) -> np.ndarray:
    """e_perp by reflecting twice from sample to sample; global error of order four."""
    values = curve.derivatives(thetas, 1)
    points, tangents = values[:, 0], values[:, 1]
    tangents = tangents / np.linalg.norm(tangents, axis=1, keepdims=True)
    frames = [normal]
    for i in range(len(thetas) - 1):
        chord = points[i + 1] - points[i]
        square = chord @ chord
        mirrored = frames[-1] - 2 / square * (chord @ frames[-1]) * chord
        tangent = tangents[i] - 2 / square * (chord @ tangents[i]) * chord
        second = tangents[i + 1] - tangent
        frames.append(mirrored - 2 / (second @ second) * (second @ mirrored) * second)
    return np.array(frames)


def _reference(curve: Curve, normal: np.ndarray, per_segment: int) -> tuple[np.ndarray, np.ndarray]:
    """The same with Richardson's extrapolation, at the coarse samples."""
    breaks = curve.breakpoints

    def grid(count: int) -> np.ndarray:
        parts = [np.linspace(a, b, count, endpoint=False) for a, b in itertools.pairwise(breaks)]
        return np.append(np.concatenate(parts), breaks[-1])

    coarse = _double_reflection(curve, normal, grid(per_segment))
    fine = _double_reflection(curve, normal, grid(2 * per_segment))[::2]
    return grid(per_segment), fine + (fine - coarse) / 15.0


@pytest.mark.slow(but=["open_spline-600", "twisted-3000"])
@pytest.mark.parametrize(
    ("name", "samples"),
    [("lemniscate", 3000), ("twisted", 3000), ("bumps", 800), ("open_spline", 600)],
)
def test_agrees_with_double_reflection(
    name: str, samples: int, request: pytest.FixtureRequest
) -> None:
    curve = request.getfixturevalue(name)
    frame = ParallelTransportFrame(curve)
    start = frame.normals(curve.domain[0])[0]
    thetas, expected = _reference(curve, start, samples)
    # One revolution, without its end: there the next one begins.
    e_perp, e_cross = frame.normals(thetas[:-1])
    assert np.abs(e_perp - expected[:-1]).max() < 1e-9
    tangents = curve.derivatives(thetas[:-1], 1)[:, 1]
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    np.testing.assert_allclose(np.einsum("ij,ij->i", e_perp, tangents), 0.0, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(e_perp, axis=1), 1.0, rtol=1e-14)
    np.testing.assert_allclose(e_cross, np.cross(tangents, e_perp), atol=1e-15)


def test_satisfies_3_4(twisted: FourierCurve) -> None:
    frame = ParallelTransportFrame(twisted)
    h = 1e-3
    for theta in np.linspace(0.1, 6.1, 13):
        nodes = theta + h * np.array([-2, -1, 1, 2])
        weights = np.array([1, -8, 8, -1]) / (12 * h)
        derivative = weights @ frame.normals(nodes)[0]
        tangents = twisted.derivatives(nodes, 1)[:, 1]
        tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
        e_par = twisted.derivatives(theta, 1)[1]
        e_par /= np.linalg.norm(e_par)
        expected = -((weights @ tangents) @ frame.normals(theta)[0]) * e_par
        np.testing.assert_allclose(derivative, expected, atol=1e-9)


def test_holonomy_is_minus_the_total_torsion(twisted: FourierCurve) -> None:
    def torsion_rate(theta: float) -> float:
        _, d1, d2, d3 = twisted.derivatives(theta, 3)
        binormal = np.cross(d1, d2)
        return float(binormal @ d3 / (binormal @ binormal) * np.linalg.norm(d1))

    total = quad(torsion_rate, 0.0, 2 * math.pi, epsabs=1e-12, limit=400)[0]
    expected = math.remainder(-total, 2 * math.pi)
    frame = ParallelTransportFrame(twisted)
    assert abs(expected) > 0.05
    assert frame.holonomy == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("revolutions", [-2, -1, 1, 3])
def test_revolutions_turn_the_frame_and_join_smoothly(
    twisted: FourierCurve, revolutions: int
) -> None:
    frame = ParallelTransportFrame(twisted)
    period = twisted.period
    theta = np.array([0.0, 1.0, 5.0])
    e_perp, e_cross = frame.normals(theta)
    turned, _ = frame.normals(theta + revolutions * period)
    angle = revolutions * frame.holonomy
    np.testing.assert_allclose(
        turned, math.cos(angle) * e_perp + math.sin(angle) * e_cross, atol=1e-12
    )
    seam = revolutions * period
    before, after = frame.normals(seam - 1e-9)[0], frame.normals(seam + 1e-9)[0]
    np.testing.assert_allclose(before, after, atol=1e-7)
    np.testing.assert_allclose(before - after, 0.0, atol=2e-8)


def test_straight_line_keeps_its_normal() -> None:
    line = PiecewisePolynomialCurve.line([0, 0, 0], [1, 1, 0])
    e_perp, e_cross = ParallelTransportFrame(line).normals([0.0, 0.5, 1.4])
    np.testing.assert_allclose(e_perp, [[0, 0, 1]] * 3, atol=1e-15)
    np.testing.assert_allclose(e_cross, np.array([[1, -1, 0]] * 3) / math.sqrt(2), atol=1e-15)


def test_planar_curve_keeps_the_normal_of_its_plane() -> None:
    circle = FourierCurve.circle([0, 0, 0], 0.3)
    frame = ParallelTransportFrame(circle)
    e_perp, _ = frame.normals(np.linspace(-9, 9, 40))
    np.testing.assert_allclose(e_perp, [[0, 0, 1]] * 40, atol=1e-13)
    assert frame.holonomy == pytest.approx(0.0, abs=1e-12)


def test_initial_normal() -> None:
    up = PiecewisePolynomialCurve.line([0, 0, 0], [0.1, 0, 1])
    e_perp = ParallelTransportFrame(up).normals(0.0)[0]
    np.testing.assert_allclose(e_perp, np.array([1, 0, -0.1]) / math.hypot(1, 0.1), atol=1e-15)
    e_perp = ParallelTransportFrame(up, [0, -3, 0]).normals(0.0)[0]
    np.testing.assert_allclose(e_perp, [0, -1, 0], atol=1e-15)


def test_curvature_may_jump_at_a_breakpoint() -> None:
    # A line that becomes a parabola in a plane, and then leaves the plane: only C^1.
    curve = PiecewisePolynomialCurve(
        [0.0, 1.0, 2.0, 3.0],
        [
            [[0, 0, 0], [1, 0, 0], [0, 0, 0]],
            [[1, 0, 0], [1, 0, 0], [0, 1, 0]],
            [[2, 1, 0], [1, 2, 0], [0, 0, 1]],
        ],
    )
    assert curve.smoothness == 1
    e_0 = np.array([0.0, 0.6, 0.8])
    frame = ParallelTransportFrame(curve, e_0)
    np.testing.assert_allclose(frame.normals(np.linspace(0, 1, 50))[0], [e_0] * 50, atol=1e-13)
    # On each later piece the tangent moves on a great circle: one minimal rotation.
    t_1 = np.array([1.0, 0.0, 0.0])
    t_2, t_3 = np.array([1, 2, 0]) / math.sqrt(5), np.array([1, 2, 2]) / 3.0
    e_2 = e_0 - (e_0 @ t_2) / (1 + t_1 @ t_2) * (t_1 + t_2)
    e_3 = e_2 - (e_2 @ t_3) / (1 + t_2 @ t_3) * (t_2 + t_3)
    np.testing.assert_allclose(frame.normals([2.0, 3.0])[0], [e_2, e_3], atol=1e-12)


def test_kinks_too_small_to_be_refused_do_not_add_up() -> None:
    """150 tangents, each turned by 9e-10 from the last, and then a bend across them.

    The frame has to follow every turn: what were left of e_perp along the tangent would turn it
    about the tangent in the bend.
    """
    kink, count = 9e-10, 150
    angle = kink * np.arange(count + 1)
    directions = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    points = np.vstack([np.zeros(3), np.cumsum(directions, axis=0)]) * 0.01
    coefficients = np.zeros((count + 1, 3, 3))
    coefficients[:, 0], coefficients[:, 1] = points[:-1], directions
    breaks = 0.01 * np.arange(count + 2)
    breaks[-1] = breaks[-2] + 1.0
    coefficients[-1, 2, 2] = 1.0  # sigma'' upwards: the tangent turns by atan(2)
    curve = PiecewisePolynomialCurve(breaks, coefficients)
    assert curve.first_discontinuity(1) is None
    e_0 = np.array([0.0, math.sqrt(0.5), math.sqrt(0.5)])
    found = ParallelTransportFrame(curve, e_0).normals(breaks[-1])[0]
    # two turns on great circles, from the first tangent to the last straight one, and up
    first, last = directions[0], directions[-1]
    end = (last + np.array([0.0, 0.0, 2.0])) / math.sqrt(5.0)
    e_1 = e_0 - (e_0 @ last) / (1.0 + first @ last) * (first + last)
    e_2 = e_1 - (e_1 @ end) / (1.0 + last @ end) * (last + end)
    np.testing.assert_allclose(found, e_2, atol=1e-9)


def test_errors() -> None:
    with pytest.raises(InputError, match="dimension 2; 3"):
        ParallelTransportFrame(PiecewisePolynomialCurve.line([0, 0], [1, 0]))
    corner = PiecewisePolynomialCurve([0, 1, 2], [[[0, 0, 0], [1, 0, 0]], [[1, 0, 0], [0, 1, 0]]])
    with pytest.raises(InputError, match="tangent jumps at theta = 1;"):
        ParallelTransportFrame(corner)
    line = PiecewisePolynomialCurve.line([0, 0, 0], [1, 0, 0])
    with pytest.raises(InputError, match="not parallel"):
        ParallelTransportFrame(line, [2, 0, 0])
    with pytest.raises(InputError, match="3 finite values"):
        ParallelTransportFrame(line, [1, 0])
    with pytest.raises(InputError, match="theta: 5"):
        ParallelTransportFrame(line).normals(5.0)


def test_closed_spline_returns_after_a_revolution() -> None:
    rng = np.random.default_rng(11)
    angle = 2 * np.pi * np.arange(9) / 9
    points = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    curve = interpolate(points + 0.2 * rng.normal(size=points.shape), smoothness=4, closed=True)
    frame = ParallelTransportFrame(curve)
    thetas, expected = _reference(curve, frame.normals(0.0)[0], 400)
    assert abs(frame.holonomy) > 1e-3
    np.testing.assert_allclose(frame.normals(curve.period)[0], expected[-1], atol=1e-9)
    assert thetas[-1] == curve.period


@pytest.mark.slow
def test_noisy_waypoints_agree_with_an_integration_step_by_step() -> None:
    """Segments from short to long, bends as narrow as noise makes them, jumps of curvature."""
    random = np.random.default_rng(7)
    steps = random.uniform(0.002, 0.05, 25)
    points = np.stack([np.cumsum(steps), np.zeros(25), np.zeros(25)], axis=1)
    curve = interpolate(points + 2e-3 * random.normal(size=points.shape), smoothness=2)
    frame = ParallelTransportFrame(curve)
    normal = frame.normals(curve.domain[0])[0]

    def rate(theta: float, e_perp: np.ndarray, inside: float) -> np.ndarray:
        slope, bend = curve.derivatives(min(theta, inside), 2)[1:]
        change = bend - (bend @ slope) / (slope @ slope) * slope
        return np.asarray(-(change @ e_perp) / (slope @ slope) * slope)

    for begin, end in itertools.pairwise(curve.breakpoints):
        inside = np.nextafter(end, begin)
        theta = np.linspace(begin, inside, 7)
        options = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14, "args": (inside,)}
        expected = solve_ivp(rate, (begin, end), normal, t_eval=theta, **options).y.T
        np.testing.assert_allclose(frame.normals(theta)[0], expected, rtol=0, atol=1e-11)
        normal = expected[-1]
    # it has turned far from where it began
    assert np.linalg.norm(normal - frame.normals(curve.domain[0])[0]) > 0.1
