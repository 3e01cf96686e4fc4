"""Smooth bounds of distances against Drake's."""

import itertools
import math

import casadi as ca
import numpy as np
import pytest
from pydrake.geometry import Capsule, Cylinder, Sphere
from pydrake.math import RigidTransform, RollPitchYaw

from identification.excitation import posture_clearance
from identification.excitation.balls import cover, ends
from identification.excitation.posture_clearance import (
    delta_posture_limits,
    serial_posture_limits,
    soft_max,
    soft_min,
)
from identification.excitation.scene import Obstacle
from identification.model.subject import load_subject
from pfsc_drake.robot.delta.kinematics import rod_independence


@pytest.fixture(scope="module")
def postures(comau):
    lower, upper = comau.position_limits.T
    return np.random.default_rng(5).uniform(lower, upper, (300, 6))


@pytest.fixture(scope="module")
def limits(comau, comau_cell, comau_scene):
    return serial_posture_limits(comau, comau_cell, comau_scene)


def test_what_is_allowed_is_clear_of_everything(limits, postures, comau_scene, comau_cell):
    values = limits.values(postures)
    allowed = np.all(values >= 0.0, axis=1)
    assert 10 < allowed.sum() < 200
    assert comau_scene.distances(postures[allowed]).min() >= comau_cell.clearance


@pytest.mark.parametrize("obstacle", ["socket", "floor"])
def test_bounds_are_below_distances(limits, postures, comau_scene, comau_cell, obstacle):
    numbers = [i for i, pair in enumerate(comau_scene.pairs) if pair.name.endswith(obstacle)]
    distances = comau_scene.distances(postures, np.array(numbers)).min(axis=1)
    bound = limits.values(postures)[:, limits.names.index(f"clearance of {obstacle}")]
    near = (distances < 0.3) & (distances > 0.0)
    assert near.sum() > 20
    assert np.all(bound[near] + comau_cell.clearance <= distances[near] + 1e-9)


SLANTED = {"start": np.array([0.3, -0.2, 0.1]), "end": np.array([0.7, 0.3, 0.9]), "radius": 0.15}


@pytest.mark.parametrize(
    "shape",
    [
        {"kind": "box", "center": np.array([0.3, -0.2, 0.5]), "size": np.array([0.4, 0.7, 1.1])},
        {"kind": "sphere", "center": np.array([0.3, -0.2, 0.5]), "radius": 0.25},
        {"kind": "cylinder", **SLANTED},
        {"kind": "capsule", **SLANTED},
    ],
    ids=lambda shape: shape["kind"],
)
def test_distances_from_shapes_are_tight_on_all_sides(shape):
    """Half a metre away along each axis; the rounding of edges takes at most 20 mm."""
    obstacle = Obstacle(**shape)
    half = np.full(3, obstacle.radius)
    if obstacle.kind == "box":
        half = obstacle.size / 2.0
    elif obstacle.kind != "sphere":
        cap = obstacle.radius if obstacle.kind == "capsule" else 0.0
        half[2] = math.dist(obstacle.start, obstacle.end) / 2.0 + cap
    x, y, z, *angles = obstacle.pose()
    X_WO, point = RigidTransform(RollPitchYaw(*angles), [x, y, z]), ca.SX.sym("p", 3)
    distance = ca.Function("d", [point], [posture_clearance._distance(obstacle, point)])
    for axis, side in itertools.product(range(3), (-1.0, 1.0)):
        from_center = np.zeros(3)
        from_center[axis] = side * (half[axis] + 0.5)
        assert 0.48 < float(distance(X_WO @ from_center)) <= 0.5 + 1e-9


def test_height_is_that_of_the_chain(limits, comau, postures, comau_cell):
    chain = comau.chain
    # forward kinematics with plain matrices
    R, p = np.eye(3), np.zeros(3)
    for link, angle in zip(chain.links, postures[0], strict=True):
        p, R = p + R @ link.p_PF, R @ link.R_PF
        K = np.cross(np.eye(3), link.axis)
        R = R @ (np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K)
    flange = p + R @ [0.0, 0.0, 0.1]
    value = limits.values(postures[:1])[0, limits.names.index("height of the flange")]
    assert value == pytest.approx(flange[2] - comau_cell.tool_above)


def test_ends_of_a_robot_with_its_tool(comau):
    assert list(ends(comau)) == ["flange"]
    with_tool = ends(load_subject("comau_racer_1_4", tool=True))
    np.testing.assert_allclose(with_tool["flange"], [0.0, 0.0, 0.1])
    np.testing.assert_allclose(with_tool["tool point"], [0.0, 0.0, 0.22])


def test_derivatives_exist_everywhere(limits, postures):
    """They are finite in all postures, and difference quotients."""
    jacobian = limits.function.jacobian()
    for k, q in enumerate(postures[:20]):
        slopes = np.array(jacobian(q, 0.0))
        assert np.isfinite(slopes).all()
        if k < 3:
            steps = 1e-5 * np.vstack([np.eye(6), -np.eye(6)])
            up, down = np.split(limits.values(q + steps), 2)
            np.testing.assert_allclose(slopes.T, (up - down) / 2e-5, rtol=0, atol=1e-4)


def test_balls_cover_shapes(comau, comau_scene):
    balls = cover(comau.chain, comau_scene)
    inspector, random = comau_scene.inspector, np.random.default_rng(1)
    for k, shape in enumerate(comau_scene.shapes):
        own = balls.shapes == k
        box = inspector.GetObbInGeometryFrame(shape.geometry)
        inside = random.uniform(-1.0, 1.0, (200, 3)) * np.asarray(box.half_width())
        form = inspector.GetShape(shape.geometry)
        if isinstance(form, Cylinder | Capsule | Sphere):
            half = 0.0 if isinstance(form, Sphere) else form.length() / 2.0
            beyond = np.maximum(np.abs(inside[:, 2]) - half, 0.0)
            beyond *= not isinstance(form, Cylinder)
            from_axis = np.sqrt(inside[:, 0] ** 2 + inside[:, 1] ** 2 + beyond**2)
            inside = inside[from_axis <= form.radius()]
        points = (shape.X_LG @ box.pose() @ inside.T).T
        gaps = np.linalg.norm(points[:, None] - balls.centers[own], axis=-1) - balls.radii[own]
        assert np.all(gaps.min(axis=1) <= 1e-9), shape.body


def test_soft_least_and_largest():
    values = [0.3, 0.1, 0.1001]
    assert 0.1 - 0.004 * np.log(3.0) <= float(soft_min(values)) <= 0.1
    assert float(soft_max(0.5, 0.1)) <= 0.5
    assert float(soft_max(0.5, 0.1)) == pytest.approx(0.5, abs=0.01)


def test_delta_bound_is_below_the_independence_of_its_rods(delta):
    robot = delta.delta
    limits = delta_posture_limits(robot)
    q = np.random.default_rng(2).uniform(0.05, 0.35, (20, 3))
    least = robot.parameters.workspace.min_rod_independence
    geometry = robot.parameters.geometry
    for row, (bound, below) in zip(q, limits.values(q), strict=True):
        y_t = robot.tool_position(row)
        assert 0.0 < bound + least <= rod_independence(geometry, row, y_t)
        assert below == pytest.approx(y_t[2] - geometry.h_P)
