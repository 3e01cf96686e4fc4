"""Manifolds as laws see them: coordinates by kind, and the force of a moving point."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.control.manifolds.coordinate import Kind
from pfsc_drake.control.manifolds.manifold import indices, manifold_force_function
from pfsc_drake.control.manifolds.moving_point import MovingPoint
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.geometry import quaternion_to_matrix
from pfsc_drake.jets import Jet


@pytest.mark.parametrize("oriented", [False, True])
def test_coordinates_by_kind(oriented):
    coordinates = PathManifold(3, oriented=oriented).coordinates
    assert [c.name for c in coordinates[:3]] == ["eta", "xi_1", "xi_2"]
    assert indices(coordinates, Kind.TANGENTIAL) == slice(0, 1)
    assert indices(coordinates, Kind.TRANSVERSAL) == slice(1, 3)
    rotational = indices(coordinates, Kind.ROTATIONAL)
    assert coordinates[rotational] == coordinates[3:]
    assert all(c.kind.unit == "rad" for c in coordinates[3:])


@pytest.mark.parametrize(
    ("oriented", "axis", "yaw"),
    [
        (False, None, None),
        (True, None, None),
        (True, [0.0, 0.6, 0.8], None),
        (True, None, [0, -0.6, 0.8]),
    ],
)
def test_force_of_a_moving_point_is_its_power(oriented, axis, yaw):
    """At rest, the power of a wrench is that of the force along the errors' rates."""
    rng = np.random.default_rng(3)
    manifold = MovingPoint(1, oriented=oriented, tool_axis=axis, yaw_axis=yaw)
    point = rng.uniform(-1.0, 1.0, manifold.layout.size)
    slope = point[manifold.layout.position][3:6]
    normal = np.cross(slope, rng.uniform(-1.0, 1.0, 3))
    point[manifold.layout.normal] = normal / np.linalg.norm(normal)
    twist, wrench = rng.uniform(-1, 1, 6), rng.uniform(-1, 1, 6)
    y_t, R_e = rng.uniform(-1, 1, 3), Rotation.random(random_state=3).as_matrix()
    if axis is not None:
        wrench[3:] -= R_e @ axis * (R_e @ axis @ wrench[3:])
    if yaw is not None:  # a tool with the reference's tilt
        R_d = quaternion_to_matrix(point[manifold.layout.quaternion][:4])
        R_e = Rotation.from_rotvec(0.6 * np.array(yaw)).as_matrix() @ R_d
        wrench[3:] = np.array(yaw) * (yaw @ wrench[3:])
    spin = np.cross(np.eye(3), twist[3:])
    y = Jet([ca.SX(y_t), ca.SX(twist[:3])])
    errors = manifold.virtual_output(
        y, Jet([ca.SX(R_e), ca.SX(spin @ R_e)]), ca.SX(point), [Jet([ca.SX(0.1), ca.SX(0.0)])]
    )
    values = np.array(
        [[float(ca.evalf(e.coefficients[k])) for k in (0, 1)] for e in errors], dtype=float
    )
    force = manifold_force_function(manifold)(wrench, point, values[:, 0])
    power = wrench @ twist if oriented else wrench[:3] @ twist[:3]
    assert float(np.array(force).ravel() @ values[:, 1]) == pytest.approx(power, abs=1e-12)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_angles_and_torques_are_named_by_the_axis_they_turn_about(oriented_path, axis):
    """Small turns of the tool away from the path's orientation, about one axis of it."""
    manifold, unit = PathManifold(2, oriented=True), np.eye(3)["xyz".index(axis)]
    point = oriented_path.evaluator(2).evaluate_at(0.7)
    R_d = quaternion_to_matrix(point[manifold.layout.quaternion][:4])
    R_e = Jet([ca.SX(R_d @ Rotation.from_rotvec(0.1 * unit).as_matrix()), ca.SX(3, 3)])
    y_t = Jet([ca.SX(point[manifold.layout.position][:3]), ca.SX(3, 1)])
    output = manifold.virtual_output(y_t, R_e, ca.SX(point), [])
    angles = [float(ca.DM(x.coefficients[0])) for x in output]
    wrench = np.concatenate([np.zeros(3), R_d @ unit])
    forces = np.array(manifold_force_function(manifold)(wrench, point, np.zeros(6))).ravel()
    found = list(zip(manifold.coordinates, angles, forces, strict=True))
    for coordinate, angle, force in found[3:]:
        named = coordinate.name == f"phi_{axis}"
        assert named == (coordinate.force == f"tau_{axis}")
        assert angle == pytest.approx(0.1 * named, abs=1e-12)
        assert force == pytest.approx(1.0 * named, abs=1e-12)
