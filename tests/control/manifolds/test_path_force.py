"""Manifold forces against virtual work, with motions of the tool and with a robot's Jacobian."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.control.manifolds.manifold import manifold_force_function
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.geometry import (
    FourierCurve,
    Path,
    PiecewisePolynomialCurve,
    ProjectionStatus,
    quaternion_to_matrix,
    rotation_to_axis,
)
from pfsc_drake.geometry.curves.orientation_curve import interpolate_orientation
from tests.control.manifolds.surfaces import euler_difference, path_on_cylinder

OFFSET = np.array([0.02, -0.03, 0.025])


def manifold_force(wrench, point, layout, phi=None, *, with_turning=False, **of_tool):
    """Return the force along the coordinates for a reference with angles phi."""
    manifold = PathManifold(layout.order, oriented=layout.oriented, **of_tool)
    function = manifold_force_function(manifold, with_turning=with_turning)
    reference = np.concatenate([np.full(3, 0.7), [] if phi is None else phi])
    return np.array(function(wrench, point, reference)).ravel()


def axis_output(virtual_output, C):
    """Return the virtual output with the two angles of the axis ``C e_x``."""

    def calc(path, y_t, R_e):
        R_d = path.orientation.rotation_matrix(path.nearest(y_t))
        angles = Rotation.from_matrix(C.T @ R_d.T @ R_e @ C).as_euler("ZYX")
        return np.append(virtual_output(path, y_t, R_e)[:3], angles[:2])

    return calc


def euler_output(virtual_output, convention):
    """Return the virtual output with differences of Euler angles."""

    def calc(path, y_t, R_e):
        R_d = path.orientation.rotation_matrix(path.nearest(y_t))
        angles = euler_difference(R_e, R_d, convention)
        return np.append(virtual_output(path, y_t, R_e)[:3], angles)

    return calc


def random_phi(rng):
    return rng.uniform(-1.0, 1.0, 3)


def output_rates(virtual_output, path, y_t, R_e, v, w):
    """Return d yhat / dt of a moving tool, by fourth-order differences of its definition."""

    def at(t):
        turned = Rotation.from_rotvec(w * t).as_matrix() @ R_e
        return virtual_output(path, y_t + t * v, turned)

    h = 4e-4
    return (8.0 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12.0 * h)


def place(path, theta, rng, order=2):
    """Return a tool pose beside the path, the path point there, and phi."""
    y_t = path.position.derivatives(theta, 0)[0] + OFFSET
    point = path.evaluator(order)(y_t.tolist(), theta)
    layout = path.evaluator(order).layout
    if not layout.oriented:
        return y_t, np.eye(3), point, layout, None
    phi = random_phi(rng)
    w, x, y, z = point[layout.quaternion][:4]
    R_e = Rotation.from_quat([x, y, z, w]).as_matrix() @ Rotation.from_euler("ZYX", phi).as_matrix()
    return y_t, R_e, point, layout, phi


@pytest.mark.parametrize("theta", [0.4, 1.1, 2.5, 5.0])
def test_power_of_random_motions_off_the_path(oriented_path, virtual_output, theta):
    """With the turning force tau . yhat' is the wrench's power, whatever the motion."""
    rng = np.random.default_rng(int(10 * theta))
    y_t, R_e, point, layout, phi = place(oriented_path, theta, rng)
    assert abs(point[layout.alpha][0]) > 0.01
    for _ in range(5):
        wrench, twist = rng.uniform(-20, 20, 6), 0.3 * rng.uniform(-1, 1, 6)
        rates = output_rates(virtual_output, oriented_path, y_t, R_e, *np.split(twist, 2))
        tau = manifold_force(wrench, point, layout, phi, with_turning=True)
        assert tau @ rates == pytest.approx(wrench @ twist, abs=2e-8)
        # as printed, the rotation is the one relative to the path's orientation
        slope, q = point[layout.position][3:6], point[layout.quaternion].reshape(-1, 4)
        step = 1e-5 * np.array([-1.0, 1.0])
        turn = [Rotation.from_quat(np.roll(q[0] + s * q[1], -1)) for s in step]
        w_d = (turn[1] * turn[0].inv()).as_rotvec() / 2e-5 * rates[0] / np.linalg.norm(slope)
        assert np.linalg.norm(w_d) > 1e-3
        relative = wrench[:3] @ twist[:3] + wrench[3:] @ (twist[3:] - w_d)
        assert manifold_force(wrench, point, layout, phi) @ rates == pytest.approx(
            relative, abs=2e-8
        )


@pytest.mark.parametrize("axis", [[0.0, 0.0, 1.0], [0.4, -0.2, 0.3]])
def test_power_of_torques_across_an_axis(oriented_path, virtual_output, axis):
    """What acts about the axis moves none of the coordinates, whatever they are."""
    rng, C = np.random.default_rng(12), rotation_to_axis(axis)
    for theta in (0.4, 2.5):
        y_t, R_e, point, layout, _ = place(oriented_path, theta, rng)
        output = axis_output(virtual_output, C)
        phi = output(oriented_path, y_t, R_e)[3:]
        assert np.abs(phi).min() > 0.01
        wrench, twist = rng.uniform(-20, 20, 6), 0.3 * rng.uniform(-1, 1, 6)
        about = R_e @ C[:, 0]
        rates = output_rates(output, oriented_path, y_t, R_e, *np.split(twist, 2))
        keys = {"tool_axis": axis, "with_turning": True}
        tau = manifold_force(wrench, point, layout, phi, **keys)
        across = wrench[3:] - about * (about @ wrench[3:])
        power = wrench[:3] @ twist[:3] + across @ twist[3:]
        assert tau @ rates == pytest.approx(power, abs=2e-8)
        spin = np.append(np.zeros(3), 5.0 * about)
        still = manifold_force(spin, point, layout, phi, **keys)
        assert np.abs(still).max() < 1e-12
        turned = output_rates(output, oriented_path, y_t, R_e, np.zeros(3), about)
        assert np.abs(turned).max() < 1e-8


@pytest.mark.parametrize("convention", ["zyx", "zyz"])
def test_power_of_euler_angles(oriented_path, virtual_output, convention):
    """With the turning force ``tau . yhat'`` is the wrench's power, whatever the motion."""
    rng, output = np.random.default_rng(12), euler_output(virtual_output, convention)
    for theta in (0.4, 2.5):
        y_t, R_e, point, layout, _ = place(oriented_path, theta, rng)
        phi = output(oriented_path, y_t, R_e)[3:]
        assert np.abs(phi).min() > 0.01
        for _ in range(2):
            wrench, twist = rng.uniform(-20, 20, 6), 0.3 * rng.uniform(-1, 1, 6)
            rates = output_rates(output, oriented_path, y_t, R_e, *np.split(twist, 2))
            tau = manifold_force(wrench, point, layout, phi, with_turning=True, euler=convention)
            assert tau @ rates == pytest.approx(wrench @ twist, abs=1e-7)


def test_virtual_work_of_an_axis_with_the_jacobian_of_a_robot(
    load_robot, oriented_path, virtual_output
):
    """A' tau = J_g' wrench of six joints and five coordinates, for torques across the axis."""
    robot, C = load_robot("comau_racer_1_4"), rotation_to_axis([0.0, 0.0, 1.0])
    rng = np.random.default_rng(8)
    y_t, R_e, *_ = place(oriented_path, 1.1, rng)
    q = robot.reach(y_t, R_e)
    evaluator = oriented_path.evaluator(2)
    point, layout = evaluator(y_t.tolist(), 1.1), evaluator.layout

    def output(q):
        pose = robot.tool_pose(np.concatenate([q, np.zeros(6)]))
        return axis_output(virtual_output, C)(oriented_path, *pose)

    h = 4e-4
    A = np.array(
        [
            (8 * (output(q + d) - output(q - d)) - (output(q + 2 * d) - output(q - 2 * d))) / 12 / h
            for d in h * np.eye(6)
        ]
    ).T
    wrench = rng.uniform(-30.0, 30.0, 6)
    wrench[3:] -= R_e[:, 2] * (R_e[:, 2] @ wrench[3:])
    tau = manifold_force(
        wrench, point, layout, output(q)[3:], with_turning=True, tool_axis=[0.0, 0.0, 1.0]
    )
    joint_torques = robot.jacobian(q).T @ np.concatenate([wrench[3:], wrench[:3]])
    assert np.allclose(A.T @ tau, joint_torques, rtol=0, atol=1e-8)


def test_virtual_work_with_the_jacobian_of_a_robot(load_robot, oriented_path, virtual_output):
    """A' tau = J_g' wrench, with A = d yhat / dq by differences and J_g from Drake."""
    robot = load_robot("comau_racer_1_4")
    rng = np.random.default_rng(8)
    y_t, R_e, *_ = place(oriented_path, 1.1, rng)
    R_e = R_e @ Rotation.from_euler("ZYX", [0.0, 0.1, 0.0]).as_matrix()
    q = robot.reach(y_t, R_e)
    y_t, R_e = robot.tool_pose(np.concatenate([q, np.zeros(6)]))
    evaluator = oriented_path.evaluator(2)
    point, layout = evaluator(y_t.tolist(), 1.1), evaluator.layout

    def output(q):
        return virtual_output(oriented_path, *robot.tool_pose(np.concatenate([q, np.zeros(6)])))

    h = 4e-4
    A = np.array(
        [
            (8 * (output(q + d) - output(q - d)) - (output(q + 2 * d) - output(q - 2 * d))) / 12 / h
            for d in h * np.eye(6)
        ]
    ).T
    wrench = rng.uniform(-30.0, 30.0, 6)
    tau = manifold_force(wrench, point, layout, output(q)[3:], with_turning=True)
    joint_torques = robot.jacobian(q).T @ np.concatenate([wrench[3:], wrench[:3]])
    assert np.allclose(A.T @ tau, joint_torques, rtol=0, atol=1e-8)
    # (3.41) as printed: with J_p = L_p J_g, whose rotational rows are those of omega
    slope = point[layout.position][3:6]
    e_par, e_perp = slope / np.linalg.norm(slope), point[layout.normal]
    beta = 1.0 / (1.0 - point[layout.alpha][0])
    J_w, J_t = np.split(robot.jacobian(q), 2)
    J_p = np.vstack([beta * e_par @ J_t, e_perp @ J_t, np.cross(e_par, e_perp) @ J_t, J_w])
    printed = manifold_force(wrench, point, layout, output(q)[3:])[:3]
    work = J_p.T @ np.concatenate([printed, wrench[3:]])
    assert np.allclose(work, joint_torques, rtol=0, atol=1e-10)


def test_half_way_to_the_centre_of_a_circle_the_tangential_force_is_half(virtual_output):
    circle = FourierCurve.circle([0.0, 0.0, 0.5], 0.2)
    path, rng = Path(circle), np.random.default_rng(1)
    y_t = np.array([0.1 * math.cos(0.7), 0.1 * math.sin(0.7), 0.52])
    evaluator = path.evaluator(3)
    point, layout = evaluator(y_t.tolist(), 0.7), evaluator.layout
    assert point[layout.alpha] == pytest.approx([0.5], abs=1e-12)
    tangent = np.array([-math.sin(0.7), math.cos(0.7), 0.0])
    tau = manifold_force(np.array([*tangent, 0, 0, 0]) * 8.0, point, layout)
    assert tau == pytest.approx([4.0, 0.0, 0.0], abs=1e-12)
    wrench, v = rng.uniform(-20, 20, 6), rng.uniform(-0.1, 0.1, 3)
    rates = output_rates(virtual_output, path, y_t, np.eye(3), v, np.zeros(3))
    power = manifold_force(wrench, point, layout) @ rates
    assert power == pytest.approx(wrench[:3] @ v, abs=1e-8)


def test_beyond_the_end_of_an_open_path():
    """There the path goes on straight and does not turn."""
    arc = PiecewisePolynomialCurve(
        [0.0, 0.5], np.array([[[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.6, 0.0]]])
    )
    angles = np.array([[0.0, 0.0, 0.0], [0.3, 0.1, -0.2]])
    quaternions = np.roll(Rotation.from_euler("ZYX", angles).as_quat(), 1, axis=1)
    path = Path(arc, interpolate_orientation(quaternions, [0.0, 0.5], smoothness=3))
    evaluator = path.evaluator(2)
    sigma, slope = arc.derivatives(0.5, 1)
    e_par = slope / np.linalg.norm(slope)
    # where the run-out is over
    y_t = sigma + 0.3 * e_par + 0.05 * np.cross([0.0, 0.0, 1.0], e_par)
    point, layout = evaluator(y_t.tolist(), 0.5), evaluator.layout
    assert point[layout.status] == [ProjectionStatus.BEYOND_END]
    slope = point[layout.position][3:6]
    e_par = slope / np.linalg.norm(slope)
    assert not point[layout.quaternion][4:].any()
    wrench = np.array([*(7.0 * e_par), 3.0, -2.0, 5.0])
    for with_turning in (False, True):
        tau = manifold_force(wrench, point, layout, np.zeros(3), with_turning=with_turning)
        assert tau[:3] == pytest.approx([7.0, 0.0, 0.0], abs=1e-12)
    # at zero angles the torques are those about z, y, x of the path's orientation
    R_d = quaternion_to_matrix(point[layout.quaternion][:4])
    assert tau[3:] == pytest.approx((R_d.T @ wrench[3:])[::-1], abs=1e-12)


def test_the_norm_of_the_quaternion_does_not_matter(oriented_path):
    rng = np.random.default_rng(3)
    _, _, point, layout, phi = place(oriented_path, 0.9, rng)
    wrench = rng.uniform(-1, 1, 6)
    expected = manifold_force(wrench, point, layout, phi, with_turning=True)
    point[layout.quaternion] *= 3.0
    tau = manifold_force(wrench, point, layout, phi, with_turning=True)
    assert np.allclose(tau, expected, rtol=1e-13, atol=1e-13)


def test_what_is_not_finite_stays_so(oriented_path):
    *_, point, layout, phi = place(oriented_path, 0.9, np.random.default_rng(5))
    assert np.isnan(manifold_force(np.full(6, np.nan), point, layout, phi)).all()
    nowhere = np.full_like(point, np.nan)
    assert np.isnan(manifold_force(np.ones(6), nowhere, layout, phi, with_turning=True)).all()


def test_power_beside_a_path_whose_frame_turns(virtual_output):
    """On a surface: a tool that keeps its side step moves with the frame's turn."""
    path, rng = path_on_cylinder(), np.random.default_rng(6)
    y_t, R_e, point, layout, _ = place(path, 0.7, rng)
    assert abs(point[layout.turn][0]) > 0.1
    manifold = PathManifold(2, oriented=False, turning=True)
    still = virtual_output(path, y_t, R_e)
    for _ in range(3):
        wrench, v = rng.uniform(-20, 20, 6), rng.uniform(-0.3, 0.3, 3)
        rates = output_rates(virtual_output, path, y_t, R_e, v, np.zeros(3))
        tau = np.array(manifold_force_function(manifold)(wrench, point, still)).ravel()
        assert tau @ rates == pytest.approx(wrench[:3] @ v, abs=2e-8)
