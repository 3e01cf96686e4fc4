"""Differences of Euler angles: jumps, singularities, and the analytic Jacobian by other means."""

import casadi as ca
import numpy as np
import pytest
from pydrake.math import RollPitchYaw
from scipy.spatial.transform import Rotation

from pfsc_drake.control.law.linearization import decoupling_function
from pfsc_drake.control.manifolds.orientation import (
    ToolOrientation,
    euler_difference,
    euler_rates,
    quaternion_rotation,
)
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.control.manifolds.space import SpaceManifold
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import euler_margin, zyx_to_matrix, zyx_to_quaternion
from pfsc_drake.geometry.rotation import zyz_to_matrix
from pfsc_drake.jets import Jet

TO_MATRIX = {"zyx": zyx_to_matrix, "zyz": zyz_to_matrix}
ANGLES = {"zyx": [0.7, -0.4, 2.9], "zyz": [0.7, 1.1, 2.9]}


def value(angles_e, angles_d, convention):
    """Return the difference for references of any norm."""
    R_e, R_d = (TO_MATRIX[convention](angles) for angles in (angles_e, angles_d))
    q_d = 1.7 * np.roll(Rotation.from_matrix(R_d).as_quat(), 1)
    found = euler_difference(Jet([ca.SX(R_e)]), quaternion_rotation(Jet([ca.SX(q_d)])), convention)
    return np.array([float(ca.evalf(angle.coefficients[0])) for angle in found])


@pytest.mark.parametrize("convention", TO_MATRIX)
def test_differences_do_not_jump_where_an_angle_does(convention):
    second = ANGLES[convention][1]
    for phi in ([0.3, 0.2, -0.3], [-2.5, -0.1, 3.0]):
        for first in (3.0, 3.1, -3.1, 0.0):
            reference = np.array([first, second, -first])
            found = value(reference + phi, reference, convention)
            np.testing.assert_allclose(found, phi, rtol=0, atol=1e-13)


@pytest.mark.parametrize("convention", TO_MATRIX)
def test_rates_are_those_of_rotations(convention):
    """T (2.15) by differences of rotation matrices, and Drake's where Drake has it."""
    Phi, step = np.array(ANGLES[convention]), 1e-5
    T = np.array(ca.evalf(euler_rates(ca.SX(Phi), convention)))
    for i, unit in enumerate(step * np.eye(3)):
        after, before = (TO_MATRIX[convention](Phi + s * unit) for s in (1.0, -1.0))
        turn = Rotation.from_matrix(after @ before.T).as_rotvec() / (2.0 * step)
        np.testing.assert_allclose(T[:, i], turn, rtol=0, atol=1e-9)
    if convention == "zyx":
        drake = RollPitchYaw(*Phi[::-1]).CalcRpyDtFromAngularVelocityInParent
        for omega in np.eye(3):
            rates = drake(omega).ravel()[::-1]
            np.testing.assert_allclose(np.linalg.solve(T, omega), rates, rtol=0, atol=1e-13)


@pytest.mark.parametrize("convention", TO_MATRIX)
def test_the_law_has_the_analytic_jacobian(convention, load_robot):
    """(2.16) with Drake's Jacobian; the orientation to keep does not matter to it."""
    robot = load_robot("comau_racer_1_4")
    q = np.array([0.2, 1.9, -0.8, 0.3, 1.2, -0.4])
    y_t, R_e = robot.tool_pose(np.concatenate([q, np.zeros(6)]))
    J = robot.jacobian(q)
    Phi = Rotation.from_matrix(R_e).as_euler(convention.upper())
    T = np.array(ca.evalf(euler_rates(ca.SX(Phi), convention)))
    expected = np.vstack([J[3:], np.linalg.solve(T, J[:3])])
    for angles in ([0.3, 0.5, 2.8], [0.1, -0.2, 3.0]):
        manifold = SpaceManifold(1, zyx_to_quaternion(angles), euler=convention)
        A = np.array(decoupling_function(robot.chain, manifold)(q, manifold.point(y_t)))
        np.testing.assert_allclose(A, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("convention", TO_MATRIX)
def test_the_margin_is_the_angle_to_where_t_is_singular(convention):
    middle = {"zyx": 0.0, "zyz": np.pi / 2.0}[convention]
    margins = np.array([0.01, 0.3, 1.5])
    for sign in (-1.0, 1.0):
        second = middle + sign * (np.pi / 2.0 - margins)
        R = TO_MATRIX[convention](np.stack([0.4 + 0 * second, second, 1.0 + 0 * second], axis=1))
        np.testing.assert_allclose(euler_margin(R, convention), margins, rtol=0, atol=1e-12)
        T = [np.array(ca.evalf(euler_rates(ca.SX([0.4, b, 1.0]), convention))) for b in second]
        np.testing.assert_allclose(np.abs(np.linalg.det(T)), np.sin(margins), rtol=1e-12)


def test_names_and_what_is_refused():
    names = {
        euler: [c.name for c in ToolOrientation(euler=euler).coordinates]
        for euler in (None, "zyx", "zyz")
    }
    assert names[None] == names["zyx"] == ["phi_z", "phi_y", "phi_x"]
    assert names["zyz"] == ["phi_z", "phi_y", "phi_z2"]
    with pytest.raises(InputError, match="Euler angles xyz: unknown; allowed are zyx, zyz"):
        ToolOrientation(euler="xyz")
    with pytest.raises(InputError, match="Euler angles zyx: one of them at most"):
        ToolOrientation(tool_axis=[0, 0, 1], euler="zyx")
    with pytest.raises(InputError, match="Euler angles zyx: the path has no orientation"):
        PathManifold(2, oriented=False, euler="zyx")
