"""Beyond the ends of an open path: as smooth as the path, then straight and without turning."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from pfsc_drake.geometry import (
    Path,
    ProjectionStatus,
    WaypointTable,
    path_from_waypoints,
    quaternion_to_matrix,
    zyx_to_quaternion,
)

ORDERS = [1, 2, 4]


@pytest.fixture(scope="module")
def path() -> Path:
    angle = 2 * np.pi * np.arange(12) / 14
    positions = np.stack([np.cos(angle), np.sin(angle), 0.2 * np.sin(2 * angle + 0.4)], axis=1)
    quaternions = zyx_to_quaternion(np.stack([angle, 0.2 * np.sin(angle), 0 * angle], axis=1))
    return path_from_waypoints(WaypointTable(0.4 * positions, quaternions), smoothness=6)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("end", [0, 1])
def test_it_goes_on_as_smoothly_as_the_path(path: Path, order: int, end: int) -> None:
    """All derivatives that the law uses agree on both sides of the end."""
    evaluator, layout = path.evaluator(order), path.evaluator(order).layout
    theta, sign = path.position.domain[end], 2 * end - 1
    inside = evaluator.evaluate_at(theta)
    tangent = inside[layout.position][3:6]
    step = 1e-10
    point = inside[layout.position][:3] + sign * step * tangent
    out = evaluator(point.tolist(), theta)
    assert out[layout.status] == [ProjectionStatus.BEYOND_END]
    assert out[0] == pytest.approx(theta + sign * step, abs=1e-12)
    for place, size in ((layout.position, 3), (layout.quaternion, 4), (layout.normal, 3)):
        before, after = (x[place].reshape(-1, size) for x in (inside, out))
        scale = 1.0 + np.abs(before).max(axis=1, keepdims=True)
        np.testing.assert_allclose(after / scale, before / scale, atol=2e-4)
    speed = float(np.linalg.norm(tangent))
    assert out[layout.eta] - inside[layout.eta] == pytest.approx(sign * step * speed, abs=1e-12)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("end", [0, 1])
def test_derivatives_along_the_path(path: Path, order: int, end: int) -> None:
    """Differences of each row along the run-out against the next row; arc length by quadrature."""
    evaluator, layout = path.evaluator(order), path.evaluator(order).layout
    sign, end_theta = 2 * end - 1, path.position.domain[end]
    inside = evaluator.evaluate_at(end_theta)
    away = sign * inside[layout.position][3:6] * path.position.period
    length = abs(evaluator((inside[layout.position][:3] + away).tolist(), end_theta)[0] - end_theta)
    thetas = end_theta + sign * np.linspace(0.0, length, 401)
    points = np.array([evaluator.at(theta) for theta in thetas])[..., 0]
    h = thetas[1] - thetas[0]
    for place, size in ((layout.position, 3), (layout.quaternion, 4)):
        rows = points[:, place].reshape(len(thetas), -1, size)
        for k in range(rows.shape[1] - 1):
            slope = (rows[2:, k] - rows[:-2, k]) / (2.0 * h)
            scale = np.abs(rows[:, k + 1]).max() + np.abs(rows[:, k]).max()
            assert np.abs(slope - rows[1:-1, k + 1]).max() < 2e-3 * scale, (place, k)

    def speed(theta: float) -> float:
        return float(np.linalg.norm(np.array(evaluator.at(theta))[layout.position][3:6]))

    way = quad(speed, end_theta, thetas[-1], epsabs=1e-12)[0]
    assert points[-1, 1] - points[0, 1] == pytest.approx(way, abs=1e-10)
    normals, tangents = points[:, layout.normal], points[:, layout.position][:, 3:6]
    tangents = tangents / np.linalg.norm(tangents, axis=1, keepdims=True)
    np.testing.assert_allclose(np.sum(normals * tangents, axis=1), 0.0, atol=1e-11)
    # (3.4): the normal does not turn about the tangent
    rate = np.gradient(normals, h, axis=0)[1:-1]
    across = np.cross(tangents, normals)[1:-1]
    assert np.abs(np.sum(rate * across, axis=1)).max() < 1e-4 * np.abs(rate).max() + 1e-8


@pytest.mark.parametrize("end", [0, 1])
def test_it_ends_straight_and_turns_little(path: Path, end: int) -> None:
    evaluator, layout = path.evaluator(2), path.evaluator(2).layout
    theta, sign = path.position.domain[end], 2 * end - 1
    inside = evaluator.evaluate_at(theta)
    outwards = sign * inside[layout.position][3:6]
    outwards = outwards / np.linalg.norm(outwards)
    far = [
        evaluator((inside[layout.position][:3] + d * outwards).tolist(), theta) for d in (0.4, 0.5)
    ]
    for out in far:
        assert out[layout.status] == [ProjectionStatus.BEYOND_END]
        assert out[layout.alpha] == [0.0]
        assert not out[layout.position][6:].any()
        assert not out[layout.quaternion][4:].any()
    assert far[0][0] == far[1][0]
    assert 0.0 < sign * (far[0][0] - theta) <= 0.1 * path.position.period
    np.testing.assert_array_equal(far[0][layout.quaternion], far[1][layout.quaternion])
    R = [quaternion_to_matrix(out[layout.quaternion][:4]) for out in (inside, far[0])]
    turned = math.acos((np.trace(R[0].T @ R[1]) - 1.0) / 2.0)
    assert turned < 0.25
    final = far[0][layout.position][3:6]
    assert outwards @ final / np.linalg.norm(final) * sign > 0.9
    assert far[1][1] - far[0][1] == pytest.approx(
        0.1 * float(outwards @ final / np.linalg.norm(final)), rel=1e-9
    )
