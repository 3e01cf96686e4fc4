"""Paths: regularity, smoothness, poses, domains."""

import math

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry import (
    FourierCurve,
    OrientationCurve,
    Path,
    PiecewisePolynomialCurve,
    interpolate,
    interpolate_orientation,
    zyx_to_matrix,
    zyx_to_quaternion,
)


def _cusp(offset: float) -> PiecewisePolynomialCurve:
    # sigma' = [(t - 0.37)^2 .., t - 0.37, offset]: vanishes at 0.37 if offset is zero.
    t = 0.37
    return PiecewisePolynomialCurve(
        [0.0, 1.0], [[[0, 0, 0], [t * t, -t, offset], [-t, 0.5, 0], [1 / 3, 0, 0]]]
    )


def test_irregular_curve_is_refused() -> None:
    with pytest.raises(InputError, match=r"\|sigma'\| = .* at theta = 0\.37,"):
        Path(_cusp(0.0))
    with pytest.raises(InputError, match="regular curve"):
        Path(_cusp(1e-8))
    assert Path(_cusp(1e-3)).length > 0.0


def test_requires_three_dimensions() -> None:
    with pytest.raises(InputError, match="dimension 2; 3"):
        Path(PiecewisePolynomialCurve.line([0, 0], [1, 0]))


def test_required_smoothness() -> None:
    rng = np.random.default_rng(0)
    points = np.cumsum(rng.uniform(0.1, 0.3, (10, 3)), axis=0)
    position = interpolate(points, smoothness=4)
    q = zyx_to_quaternion(rng.uniform(-0.3, 0.3, (10, 3)))
    theta = np.linspace(*position.domain, 10)
    path = Path(position, interpolate_orientation(q, theta, smoothness=2))
    path.require_smoothness(3, "a rigid arm")
    with pytest.raises(
        InputError,
        match=r"position is of class C\^4 \(a derivative jumps at theta = .*\);"
        r" C\^5 or better is required for elastic joints",
    ):
        path.require_smoothness(5, "elastic joints")
    with pytest.raises(InputError, match=r"orientation is of class C\^2 .* C\^3 or better"):
        path.require_smoothness(4, "visco-elastic joints")
    Path(FourierCurve.bent_lemniscate()).require_smoothness(50, "anything")


def test_theta_of_the_lost_class_is_named() -> None:
    curve = PiecewisePolynomialCurve(
        [0.0, 1.0, 2.0],
        [[[0, 0, 0], [1, 0, 0], [0, 0, 0]], [[1, 0, 0], [1, 0, 0], [0, 0.5, 0]]],
    )
    with pytest.raises(InputError, match=r"C\^1 \(a derivative jumps at theta = 1\)"):
        Path(curve).require_smoothness(3, "a rigid arm")


def test_pose_on_open_path_and_beyond() -> None:
    line = PiecewisePolynomialCurve.line([0.0, 1.0, 0.0], [2.0, 1.0, 0.0])
    q = zyx_to_quaternion([[0.0, 0, 0], [1.0, 0, 0]])
    path = Path(line, interpolate_orientation(q, [0.0, 2.0], smoothness=3))
    for eta, angle in ((1.0, 0.5), (-0.25, 0.0), (2.5, 1.0)):
        position, R = path.pose(eta)
        np.testing.assert_allclose(position, [eta, 1.0, 0.0], atol=1e-12)
        np.testing.assert_allclose(R, zyx_to_matrix([angle, 0, 0]), atol=1e-12)
    assert Path(line).pose(1.0)[1] is None
    with pytest.raises(InputError, match="arc length: nan"):
        path.pose(math.nan)


def test_pose_counts_revolutions() -> None:
    circle = FourierCurve.circle([0, 0, 0.5], 0.2)
    angle = 2 * np.pi * np.arange(13) / 12
    q = zyx_to_quaternion(np.stack([angle, 0 * angle, 0 * angle], axis=1))
    path = Path(circle, interpolate_orientation(q, angle, smoothness=5, closed=True))
    assert path.closed
    assert path.length == pytest.approx(0.4 * math.pi)
    one, R_one = path.pose(0.1)
    two, R_two = path.pose(0.1 + path.length)
    np.testing.assert_allclose(one, [0.2 * math.cos(0.5), 0.2 * math.sin(0.5), 0.5], atol=1e-12)
    np.testing.assert_allclose(two, one, atol=1e-12)
    np.testing.assert_allclose(R_two, R_one, atol=1e-10)
    np.testing.assert_allclose(R_one, zyx_to_matrix([0.5, 0, 0]), atol=1e-5)


def test_constant_orientation_fits_any_path() -> None:
    fixed = OrientationCurve.fixed([1.0, 0, 0, 0], (0.0, 1.0))
    for curve in (
        FourierCurve.bent_lemniscate(),
        PiecewisePolynomialCurve.line([0] * 3, [3, 0, 0]),
    ):
        np.testing.assert_array_equal(Path(curve, fixed).pose(0.7)[1], np.eye(3))


def test_orientation_must_cover_the_path() -> None:
    q = zyx_to_quaternion([[0.0, 0, 0], [0.5, 0, 0], [1.0, 0, 0], [0.3, 0, 0]])
    line = PiecewisePolynomialCurve.line([0, 0, 0], [2, 0, 0])
    short = interpolate_orientation(q, [0.0, 0.5, 1.0, 1.5], smoothness=2)
    with pytest.raises(InputError, match=r"orientation on theta = \[0, 1\.5\]; the position"):
        Path(line, short)
    with pytest.raises(InputError, match="position is closed, orientation open"):
        Path(FourierCurve.bent_lemniscate(), short)
    closed = interpolate_orientation(q, np.arange(5.0), smoothness=2, closed=True)
    with pytest.raises(InputError, match=r"orientation on theta = \[0, 4\]"):
        Path(FourierCurve.bent_lemniscate(), closed)


def test_initial_normal_and_projection_are_passed_on() -> None:
    line = PiecewisePolynomialCurve.line([0, 0, 0], [2, 0, 0])
    path = Path(line, initial_normal=[0, 1, 0])
    np.testing.assert_allclose(path.evaluator(1).evaluate_at(0.3)[4:7], [0, 1, 0])
    assert path.nearest([1.5, 1, 1]) == pytest.approx(1.5)
