"""The table of polynomials against the curves, the arc length and the frame it is made of."""

import numpy as np
import pytest

from pfsc_drake.geometry import (
    FourierCurve,
    OrientationCurve,
    Path,
    PathPointLayout,
    PiecewisePolynomialCurve,
    interpolate,
    interpolate_orientation,
    zyx_to_quaternion,
)
from pfsc_drake.geometry.curves.curve import Curve
from pfsc_drake.geometry.paths.table import PathTable, tabulate


def _table(path: Path, order: int) -> tuple[PathTable, PathPointLayout]:
    layout = PathPointLayout(order, path.orientation is not None)
    table = tabulate(path.position, path.orientation, path.arc_length, path.frame, layout)
    return table, layout


def _rows(table: PathTable, theta: np.ndarray) -> np.ndarray:
    piece = np.searchsorted(table.breakpoints[1:-1], theta, side="right")
    powers = (theta - table.breakpoints[piece])[:, None] ** np.arange(8)
    return np.einsum("mnj,mj->mn", table.rows[piece], powers)


def _turning(curve: Curve, revolutions: int) -> OrientationCurve:
    """Orientation on other breakpoints than the curve's; `revolutions` turns a revolution."""
    part = np.linspace(0.0, 1.0, 14)
    turn = revolutions * 2.0 * np.pi * part
    angles = np.stack([turn, 0.2 * np.sin(2 * np.pi * part), 0.0 * part], axis=1)
    theta = curve.domain[0] + curve.period * part
    quaternions = zyx_to_quaternion(angles)
    return interpolate_orientation(quaternions, theta, smoothness=4, closed=curve.closed)


@pytest.mark.parametrize("name", ["lemniscate", "twisted", "bumps", "open_spline"])
@pytest.mark.parametrize("turns", [None, 0, 1])
def test_rows_agree_with_the_parts(
    name: str, turns: int | None, request: pytest.FixtureRequest
) -> None:
    curve = request.getfixturevalue(name)
    path = Path(curve, None if turns is None else _turning(curve, turns))
    table, layout = _table(path, 4)
    revolutions = 2 if curve.closed and turns == 1 else 1
    begin, end = curve.domain[0], curve.domain[0] + revolutions * curve.period
    assert table.breakpoints[0] == begin
    assert table.breakpoints[-1] == pytest.approx(end, rel=1e-15)
    theta = np.random.default_rng(0).uniform(begin, end, 3000)
    found = _rows(table, theta)
    eta = np.array([path.arc_length(value) for value in theta.tolist()])
    np.testing.assert_allclose(found[:, 1], eta, rtol=0.0, atol=1e-13 * eta.max())
    # The powers that make up the bumps cancel: the curve's own tangent is rough by 1e-12.
    atol = 2e-12 if name == "bumps" else 3e-13
    e_perp = path.frame.normals(theta)[0]
    np.testing.assert_allclose(found[:, layout.normal], e_perp, rtol=0.0, atol=atol)
    for part, expected in (
        (layout.position, curve.derivatives(theta, 5)),
        (layout.quaternion, path.orientation and path.orientation.derivatives(theta, 4)),
    ):
        if expected is not None:
            scale = np.maximum(np.abs(expected).max(axis=(0, 2), keepdims=True), 1e-300)
            error = found[:, part].reshape(expected.shape) - expected
            assert np.abs(error / scale).max() < atol
    assert not table.rows[:, [0, 2, 3]].any()


def test_a_polynomial_path_is_tabulated_exactly() -> None:
    rng = np.random.default_rng(5)
    curve = interpolate(np.cumsum(rng.uniform(0.1, 0.2, (9, 3)), axis=0), smoothness=3)
    table, layout = _table(Path(curve), 2)
    theta = rng.uniform(*curve.domain, 500)
    expected = curve.derivatives(theta, 3)
    scale = np.abs(expected).max(axis=(0, 2), keepdims=True)
    found = _rows(table, theta)[:, layout.position].reshape(expected.shape)
    np.testing.assert_allclose(found / scale, expected / scale, atol=3e-14)


def test_breakpoints_that_differ_by_rounding_are_one() -> None:
    curve = PiecewisePolynomialCurve(
        [0.0, 0.5, 1.0], [[[0, 0, 0], [1, 0, 0]], [[0.5, 0, 0], [1, 0, 0]]]
    )
    halves = np.array([[[1.0, 0, 0, 0], [0.2, 0.1, 0, 0]], [[1.1, 0.05, 0, 0], [0.2, 0, 0, 0]]])
    orientation = OrientationCurve(PiecewisePolynomialCurve([0.0, 0.5 + 2e-16, 1.0], halves))
    table, _ = _table(Path(curve, orientation), 1)
    assert np.diff(table.breakpoints).min() > 1e-7
    table, _ = _table(Path(curve), 1)
    np.testing.assert_allclose(_rows(table, np.array([0.25]))[0, 1], 0.25, atol=1e-15)


@pytest.mark.parametrize("order", [1, 4])
@pytest.mark.parametrize("tilt_deg", [1, 5, 10, 20, 30, 37.5, 45, 50, 60, 70, 80, 89, 89.999])
def test_tilted_circles_have_small_tables(tilt_deg: float, order: int) -> None:
    """e_perp and the derivatives have components that are zero but for rounding errors."""
    tilt = np.radians(tilt_deg)
    axis = [-np.sin(tilt), 0.0, np.cos(tilt)]
    path = Path(FourierCurve.circle([0.7, 0.2, 1.1], 0.15, [0.0, 1.0, 0.0], axis))
    table, layout = _table(path, order)
    assert len(table.rows) < 100
    theta = np.linspace(0.0, 6.28, 200)
    found = _rows(table, theta)
    normal = [np.cos(tilt), 0.0, np.sin(tilt)]
    e_perp = found[:, layout.normal]
    np.testing.assert_allclose(np.abs(e_perp @ normal), 1.0, rtol=0.0, atol=1e-12)
    expected = path.position.derivatives(theta, order + 1)
    np.testing.assert_allclose(
        found[:, layout.position].reshape(expected.shape), expected, rtol=0.0, atol=1e-12
    )
