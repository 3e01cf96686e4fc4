"""Path quantities at each tick against the parts and quadrature."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    FourierCurve,
    OrientationCurve,
    Path,
    PathEvaluator,
    PiecewisePolynomialCurve,
    ProjectionStatus,
    WaypointTable,
    closest_point,
    interpolate,
    interpolate_orientation,
    path_from_waypoints,
    zyx_to_quaternion,
)
from tests.geometry.paths.newton_projector import Projector


def _path(closed: bool) -> Path:
    angle = 2 * np.pi * np.arange(12) / 12
    positions = np.stack([np.cos(angle), np.sin(angle), 0.2 * np.sin(2 * angle + 0.4)], axis=1)
    # A full turn about z per revolution: the quaternion returns with its sign flipped.
    quaternions = zyx_to_quaternion(np.stack([angle, 0.2 * np.sin(angle), 0 * angle], axis=1))
    return path_from_waypoints(
        WaypointTable(0.4 * positions, quaternions), smoothness=5, closed=closed
    )


OPEN, CLOSED = _path(False), _path(True)


@pytest.mark.slow(but=["2-open", "3-closed"])
@pytest.mark.parametrize("path", [OPEN, CLOSED], ids=["open", "closed"])
@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_fields(path: Path, order: int) -> None:
    evaluator = path.evaluator(order)
    layout = evaluator.layout
    rng = np.random.default_rng(order)
    revolutions = [0] if not path.closed else [-1, 0, 1, 2]
    period = path.position.period
    for revolution in revolutions:
        theta = rng.uniform(0.1, 0.9) * period + revolution * period
        sigma, first, second = path.position.derivatives(theta, 2)
        e_perp, e_cross = path.frame.normals(theta)
        point = sigma + 0.01 * e_perp - 0.02 * e_cross
        out = evaluator(point.tolist(), theta + 0.01)
        assert out.shape == (layout.size,)
        assert out[layout.theta] == pytest.approx(theta, abs=1e-11)
        assert out[layout.status] == ProjectionStatus.OK
        alpha = (point - sigma) @ second / (first @ first)
        assert out[layout.alpha] == pytest.approx(alpha, abs=1e-9)
        eta = sum(
            quad(lambda t: float(np.linalg.norm(path.position.derivatives(t, 1)[1])), a, b)[0]
            for a, b in zip(*(lambda g: (g[:-1], g[1:]))(np.linspace(0, theta, 40)), strict=True)
        )
        assert out[layout.eta] == pytest.approx(eta, abs=1e-8)
        np.testing.assert_allclose(out[layout.normal], e_perp, atol=1e-9)
        expected = path.position.derivatives(theta, order + 1)
        found = out[layout.position].reshape(order + 2, 3)
        scale = np.abs(expected).max(axis=1, keepdims=True)
        np.testing.assert_allclose(found / scale, expected / scale, atol=1e-8)
        q = path.orientation.derivatives(theta, order)
        found = out[layout.quaternion].reshape(order + 1, 4)
        scale = np.abs(q).max(axis=1, keepdims=True)
        np.testing.assert_allclose(found / scale, q / scale, atol=1e-8)


WILD = Path(
    interpolate(
        np.cumsum(0.1 * np.random.default_rng(8).normal(size=(14, 3)) + [0.1, 0, 0], axis=0),
        smoothness=6,
    )
)
CIRCLE = Path(
    FourierCurve.circle([0.0, 0.0, 0.5], 0.3), OrientationCurve.fixed([1, 2, 0, 1], (0, 9))
)


@pytest.mark.slow(but="c")
@pytest.mark.parametrize("path", [OPEN, CLOSED, WILD, CIRCLE], ids=["open", "closed", "wild", "c"])
def test_agrees_with_the_projector_wherever_the_guess_is(path: Path) -> None:
    """Near and far guesses, points near and far, revolutions, ends, centres: the same branch."""
    evaluator, curve = path.evaluator(3), path.position
    layout = evaluator.layout
    rng = np.random.default_rng(17)
    begin, end = curve.domain
    size = np.abs(curve.derivatives(np.linspace(begin, end, 99), 4)).max(axis=(0, 2))
    projector = Projector(curve)
    more = 2.0 * curve.period if path.closed else 0.0
    for _ in range(600):
        theta = rng.uniform(begin - more, end + more)
        sigma = curve.derivatives(theta, 0)[0]
        point = (sigma + rng.normal(size=3) * path.length * rng.choice([1e-3, 1e-2, 0.2])).tolist()
        guess = theta + rng.normal() * curve.period * rng.choice([0.0, 1e-6, 1e-3, 1e-2, 0.1])
        expected = projector.project(point, guess)
        out = evaluator(point, guess)
        assert out[3] == (
            ProjectionStatus.BEYOND_END
            if expected.at_end
            else (ProjectionStatus.OK if expected.converged else ProjectionStatus.NOT_CONVERGED)
        )
        if expected.at_end:  # beyond, see test_run_out
            assert not begin < out[0] < end
            continue
        assert out[0] == pytest.approx(expected.theta, abs=3e-12 * curve.period)
        derivatives = curve.derivatives(out[0], 4)
        error = (np.array(point) - derivatives[0]) @ derivatives[1]
        curvature = (1.0 - out[2]) * (derivatives[1] @ derivatives[1])
        assert abs(error) < 3e-12 * curve.period * abs(curvature) + 1e-15
        difference = out[layout.position].reshape(5, 3) - derivatives
        np.testing.assert_array_less(np.abs(difference).max(axis=1) / size, 1e-11)


@pytest.mark.slow(but="-1.5-closed")
@pytest.mark.parametrize("path", [OPEN, CLOSED, CIRCLE], ids=["open", "closed", "circle"])
@pytest.mark.parametrize("speed", [0.0, 0.1, 1.5, -1.5])
def test_ticks_of_a_motion_need_no_further_steps(
    path: Path, speed: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At 1 ms the closest point is found to rounding from the last one, piece after piece."""
    monkeypatch.setattr(closest_point, "_MAX_STEPS", closest_point._TICK_STEPS)
    curve = path.position
    evaluator = PathEvaluator(curve, path.orientation, path.arc_length, path.frame, 2)
    eta = (0.5 if abs(speed) < 1.0 else 0.2 if speed > 0.0 else 0.8) * path.length
    theta = path.arc_length.parameter(eta)
    for tick in range(800):
        truth = path.arc_length.parameter(eta)
        e_perp, e_cross = path.frame.normals(truth)
        sigma = curve.derivatives(truth, 0)[0]
        turn = 0.01 * tick
        point = sigma + 0.01 * math.cos(turn) * e_perp + 0.02 * math.sin(turn) * e_cross
        out = evaluator(point.tolist(), theta)
        assert out[3] == ProjectionStatus.OK
        theta = out[0]
        assert theta == pytest.approx(truth, abs=1e-13 * max(1.0, abs(truth)))
        eta += 1e-3 * speed


@pytest.mark.parametrize("revolutions", [-3, -1, 1, 2])
def test_revolutions_turn_the_normal(twisted: FourierCurve, revolutions: int) -> None:
    path = Path(twisted)
    evaluator = path.evaluator(2)
    assert abs(path.frame.holonomy) > 0.05
    for theta in (0.4, 3.0, 6.1):
        unwrapped = theta + revolutions * twisted.period
        e_perp, e_cross = path.frame.normals(theta)
        angle = revolutions * path.frame.holonomy
        expected = math.cos(angle) * e_perp + math.sin(angle) * e_cross
        sigma = twisted.derivatives(theta, 0)[0]
        for out in (evaluator.evaluate_at(unwrapped), evaluator(sigma.tolist(), unwrapped + 1e-3)):
            np.testing.assert_allclose(out[4:7], expected, atol=1e-12)
            assert out[0] == pytest.approx(unwrapped, abs=1e-13)
            eta = path.arc_length(theta) + revolutions * path.length
            assert out[1] == pytest.approx(eta, abs=1e-12)


def test_the_seam_is_crossed_in_both_directions() -> None:
    evaluator, curve = CLOSED.evaluator(2), CLOSED.position
    for revolution in (-2, 0, 1):
        seam = curve.domain[0] + revolution * curve.period
        for guess, theta in ((-1e-4, 2e-4), (2e-4, -1e-4), (0.0, -1e-4), (0.0, 1e-4), (1e-4, 0.0)):
            point = curve.derivatives(seam + theta, 0)[0]
            out = evaluator(point.tolist(), seam + guess)
            assert out[0] == pytest.approx(seam + theta, abs=1e-13)
            assert out[1] == pytest.approx(CLOSED.arc_length(seam + theta), abs=1e-12)


def test_centre_of_a_circle_has_no_closest_point() -> None:
    """There alpha is one, exactly or up to rounding, whichever way it is computed."""
    evaluator = CIRCLE.evaluator(2)
    for theta in np.linspace(-7.0, 7.0, 57).tolist():
        for height in (0.5, 0.6):
            out = evaluator([0.0, 0.0, height], theta)
            assert out[2] == pytest.approx(1.0, abs=1e-12)
            assert np.isfinite(out).all()
    assert evaluator([0.0, 0.0, 0.5], 0.4)[3] == ProjectionStatus.NOT_CONVERGED


def test_made_once_for_every_order() -> None:
    assert OPEN.evaluator(2) is OPEN.evaluator(2)
    assert OPEN.evaluator(2) is not OPEN.evaluator(3)
    with pytest.raises(InputError, match="order"):
        OPEN.evaluator(0)


def test_everything_is_continuous_across_the_seam() -> None:
    evaluator = CLOSED.evaluator(3)
    period = CLOSED.position.period
    for revolution in (-1, 0, 1, 2):
        before = evaluator.evaluate_at(revolution * period - 1e-9)
        after = evaluator.evaluate_at(revolution * period + 1e-9)
        np.testing.assert_allclose(before / (1 + abs(after)), after / (1 + abs(after)), atol=1e-6)


def test_eta_is_continuous_through_an_open_end() -> None:
    evaluator = OPEN.evaluator(2)
    end = OPEN.position.domain[1]
    sigma, first = OPEN.position.derivatives(end, 1)
    e_par = first / np.linalg.norm(first)
    etas = [evaluator((sigma + d * e_par).tolist(), end)[1] for d in (-1e-7, 0.0, 1e-7)]
    np.testing.assert_allclose(np.diff(etas), 1e-7, rtol=1e-4)


def test_without_orientation() -> None:
    line = Path(PiecewisePolynomialCurve.line([0, 0, 0], [2, 0, 0]))
    evaluator = line.evaluator(4)
    out = evaluator([0.5, 0.1, 0.2], 0.4)
    assert out.size == evaluator.layout.size == 7 + 18
    np.testing.assert_allclose(out[:13], [0.5, 0.5, 0, 0, 0, 0, 1, 0.5, 0, 0, 1, 0, 0], atol=1e-14)
    beyond = evaluator([2.5, 0.1, 0.0], 1.9)
    assert beyond[1] == pytest.approx(2.5)


def test_input_that_is_not_finite() -> None:
    evaluator = CLOSED.evaluator(4)
    for point, guess in (
        ([math.nan, 0, 0], 0.1),
        ([0.0, 0, math.inf], 0.1),
        ([0.0, 0, 0], math.nan),
    ):
        out = evaluator(point, guess)
        assert out[3] == ProjectionStatus.NOT_CONVERGED
        assert np.isnan(np.delete(out, 3)).all()


def test_has_no_memory() -> None:
    evaluator = CLOSED.evaluator(3)
    first = evaluator([0.3, 0.2, 0.0], 0.3)
    unchanged = first.copy()
    evaluator([-0.3, 0.1, 0.1], 1.2)
    np.testing.assert_array_equal(first, unchanged)
    np.testing.assert_array_equal(evaluator([0.3, 0.2, 0.0], 0.3), unchanged)


def test_evaluate_at_refuses_what_is_not_on_the_path() -> None:
    with pytest.raises(InputError, match="theta: -1; the path is defined on"):
        OPEN.evaluator(2).evaluate_at(-1.0)
    with pytest.raises(InputError, match="nan"):
        CLOSED.evaluator(2).evaluate_at(math.nan)


def test_the_normal_turns_with_every_revolution_of_a_table_of_two(twisted: FourierCurve) -> None:
    """Holonomy, and an orientation that returns after two revolutions only."""
    part = np.linspace(0.0, 1.0, 14)
    turn = zyx_to_quaternion(np.stack([2.0 * np.pi * part, 0 * part, 0 * part], axis=1))
    theta = twisted.domain[0] + twisted.period * part
    orientation = interpolate_orientation(turn, theta, smoothness=3, closed=True)
    assert orientation.period == pytest.approx(2.0 * twisted.period)
    path = Path(twisted, orientation)
    assert abs(path.frame.holonomy) > 0.05
    evaluator = path.evaluator(2)
    for revolutions in (-3, -2, -1, 0, 1, 2, 3, 4):
        at = 0.7 + revolutions * twisted.period
        sigma = twisted.derivatives(at, 0)[0]
        expected = path.frame.normals(at)[0]
        for out in (evaluator(sigma.tolist(), at + 1e-3), evaluator.evaluate_at(at)):
            np.testing.assert_allclose(out[evaluator.layout.normal], expected, atol=1e-10)
            assert out[1] == pytest.approx(path.arc_length(at), abs=1e-10)


@pytest.mark.slow(but="closed")
@pytest.mark.parametrize("path", [OPEN, CLOSED, WILD], ids=["open", "closed", "wild"])
def test_the_closest_point_of_all_is_found(path: Path) -> None:
    evaluator, curve = path.evaluator(1), path.position
    samples = curve.derivatives(np.linspace(*curve.domain, 4001), 0)[:, 0]
    rng = np.random.default_rng(5)
    for _ in range(100):
        point = rng.choice(samples) + rng.normal(size=3) * path.length * rng.choice([1e-3, 0.02])
        out = evaluator(point.tolist(), float(evaluator.find(point)))
        reached = np.linalg.norm(point - out[evaluator.layout.position][:3])
        assert reached < np.linalg.norm(samples - point, axis=1).min() + 1e-6 * path.length
        if out[3] == ProjectionStatus.OK:
            assert curve.domain[0] <= out[0] <= curve.domain[1]


COORDINATE = st.floats(-0.5, 0.5)
LEMNISCATE = Path(FourierCurve.bent_lemniscate())
ALONG = np.linspace(*LEMNISCATE.position.domain, 20001)
SAMPLES = LEMNISCATE.position.derivatives(ALONG, 0)[:, 0]


@given(COORDINATE, COORDINATE, COORDINATE)
@settings(max_examples=60, deadline=None)
def test_the_closest_point_on_a_curve_that_crosses_itself(x: float, y: float, z: float) -> None:
    # Not on the curve's planes of symmetry, where two minima are equal or merge.
    point = np.array([0.7013 + x, 0.2007 + y, 1.153 + z])
    sigma = LEMNISCATE.position.derivatives(LEMNISCATE.nearest(point), 0)[0]
    least = np.linalg.norm(SAMPLES - point, axis=1).min()
    assert np.linalg.norm(sigma - point) <= least + 1e-12


def test_a_point_is_found_for_infinite_input() -> None:
    """It must be a number, whichever: the projection tells that the point is nowhere."""
    for value in (math.nan, math.inf, -math.inf, 1e300):
        assert math.isfinite(CLOSED.evaluator(1).find([0.0, value, 0.0]))
