"""Jets of tangential, transversal and rotational coordinates along prescribed tool motions."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.law.linearization import linearize
from pfsc_drake.control.manifolds.orientation import ToolOrientation
from pfsc_drake.control.manifolds.path import PathGeometry, PathManifold, path_coordinates
from pfsc_drake.geometry import (
    FourierCurve,
    Path,
    PiecewisePolynomialCurve,
    quaternion_to_matrix,
)
from pfsc_drake.jets import Jet
from tests.control.manifolds.surfaces import euler_difference, path_on_cylinder
from tests.control.manifolds.tool_motion import NODES, ORDER, ToolMotion, assert_derivatives

WHOLE = ToolOrientation()


def straight_piece():
    """A straight path whose parameter does not run uniformly, so that sigma'' is not zero."""
    t = np.linspace(0.0, 2.0, 2)
    rise = np.outer([0.0, 1.0, 0.3, -0.1], [0.6, -0.3, 0.5])
    return PiecewisePolynomialCurve(t, (rise + np.outer([1, 0, 0, 0], [0.1, 0.2, 0.3]))[None])


@pytest.fixture(
    params=["lemniscate", "oriented", "circle, alpha one half", "straight", "on a surface"],
    name="situation",
)
def fixture_situation(request, oriented_path):
    """A path, a parameter on it, and the tool's offset from there in the plane across."""
    circle = FourierCurve.circle([0.4, 0.1, 0.8], 0.2, [1, 0, 0.2], [0, 1, 0.3])
    theta = 0.5
    inwards = circle.constant - circle.derivatives(theta, 0)[0]
    return {
        "lemniscate": (Path(FourierCurve.bent_lemniscate()), 0.9, [0.01, -0.02, 0.015]),
        "oriented": (oriented_path, 2.45, [0.01, 0.015, -0.02]),
        "circle, alpha one half": (Path(circle), theta, 0.5 * inwards),
        "on a surface": (path_on_cylinder(), 0.7, [0.03, -0.02, 0.025]),
        "straight": (Path(straight_piece()), 0.8, [0.05, 0.02, -0.04]),
    }[request.param]


def tool_motion(path, theta, offset, rng):
    """Return a motion that begins at an offset from a place of the path."""
    sigma, slope = path.position.derivatives(theta, 1)
    tangent = slope / np.linalg.norm(slope)
    angles = np.zeros(3)
    if path.orientation is not None:
        R_d = quaternion_to_matrix(path.orientation.derivatives(theta, 0)[0])
        angles = Rotation.from_matrix(R_d).as_euler("ZYX") + 0.1
    start = sigma + offset - (tangent @ offset) * tangent
    return ToolMotion(start, 0.15 * tangent, angles, rng)


def jets_of_outputs(path, theta, motion, order=ORDER, tool=WHOLE):
    """Return derivatives 0..order of the outputs, one row each."""
    evaluator = path.evaluator(order)
    point, layout = evaluator(motion.at(0.0)[0].tolist(), theta), evaluator.layout
    quaternion = point[layout.quaternion].reshape(-1, 4)
    geometry = PathGeometry(
        ca.SX(point[layout.eta]),
        ca.SX(point[layout.normal]),
        [ca.SX(row) for row in point[layout.position].reshape(-1, 3)],
        [ca.SX(row) for row in quaternion],
        tool,
        [ca.SX(x) for x in point[layout.turn]],
    )
    outputs = path_coordinates(motion.y.truncate(order), motion.R.truncate(order), geometry)
    rows = [[float(ca.evalf(y.derivative(k))) for y in outputs] for k in range(order + 1)]
    return np.array(rows), point


def outputs_over_time(path, point, motion, times, tool=WHOLE):
    """Return the outputs from root finding, quadrature and transport, one row per time."""
    curve, (theta, eta) = path.position, point[:2]

    def across(s, y):
        sigma, slope = curve.derivatives(s, 1)
        return (y - sigma) @ slope

    def transport(s, e_perp):
        slope, bend = curve.derivatives(s, 2)[1:]
        speed = np.linalg.norm(slope)
        e_par = slope / speed
        return -(((bend - (bend @ e_par) * e_par) / speed) @ e_perp) * e_par

    rows = []
    for t in times:
        y, R_e = motion.at(t)
        s = brentq(across, theta - 0.4, theta + 0.4, args=(y,), xtol=1e-15, rtol=1e-15)
        length = quad(lambda u: np.linalg.norm(curve.derivatives(u, 1)[1]), theta, s, epsabs=1e-14)[
            0
        ]
        tight = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-15}
        if path.frame.turns:
            e_perp = path.frame.normals(s)[0]
        else:
            e_perp = solve_ivp(transport, (theta, s), point[4:7], **tight).y[:, -1]
        sigma, slope = curve.derivatives(s, 1)
        e_par = slope / np.linalg.norm(slope)
        row = [eta + length, e_perp @ (y - sigma), np.cross(e_par, e_perp) @ (y - sigma)]
        if path.orientation is not None:
            R_d = quaternion_to_matrix(path.orientation.derivatives(s, 0)[0])
            C = np.eye(3) if tool.alignment is None else tool.alignment
            angles = Rotation.from_matrix(C.T @ R_d.T @ R_e @ C).as_euler("ZYX").tolist()
            if tool.yaw_axis is not None:
                *v, w = Rotation.from_matrix(R_e @ R_d.T).as_quat(canonical=True)
                angles = [2.0 * np.arctan2(tool.yaw_axis @ v, w)]
            if tool.euler is not None:
                angles = euler_difference(R_e, R_d, tool.euler).tolist()
            row += angles[: len(tool.coordinates)]
        rows.append(row)
    return np.array(rows)


@pytest.mark.slow(but=["on a surface-2", "oriented-1", "circle, alpha one half-2", "lemniscate-1"])
@pytest.mark.parametrize("seed", [1, 2])
def test_jets_are_derivatives_of_the_outputs(situation, seed):
    path, theta, offset = situation
    motion = tool_motion(path, theta, np.asarray(offset), np.random.default_rng(seed))
    check_jets(path, theta, motion)


@pytest.mark.parametrize("axis", [[0.0, 0.0, 1.0], [0.2, -0.4, 0.3]])
def test_jets_of_an_axis_are_derivatives_of_the_outputs(oriented_path, axis):
    motion = tool_motion(
        oriented_path, 2.45, np.array([0.01, 0.015, -0.02]), np.random.default_rng(4)
    )
    check_jets(oriented_path, 2.45, motion, ToolOrientation(tool_axis=axis))


@pytest.mark.parametrize("axis", [[0.0, 0.0, 1.0], [0.2, -0.4, 0.3]])
def test_jets_of_a_turn_about_an_axis_are_derivatives_of_the_outputs(oriented_path, axis):
    """Of a tool that is tilted, too: the twist of the rotation between it and its reference."""
    motion = tool_motion(
        oriented_path, 2.45, np.array([0.01, 0.015, -0.02]), np.random.default_rng(4)
    )
    check_jets(oriented_path, 2.45, motion, ToolOrientation(yaw_axis=axis))


@pytest.mark.parametrize("convention", ["zyx", "zyz"])
def test_jets_of_euler_angles_are_derivatives_of_the_outputs(oriented_path, convention):
    """The tool's own angles less the reference's, which moves with the tool."""
    motion = tool_motion(
        oriented_path, 2.45, np.array([0.01, 0.015, -0.02]), np.random.default_rng(4)
    )
    check_jets(oriented_path, 2.45, motion, ToolOrientation(euler=convention))


def check_jets(path, theta, motion, tool=WHOLE):
    jets, point = jets_of_outputs(path, theta, motion, tool=tool)
    assert_derivatives(jets, outputs_over_time(path, point, motion, NODES, tool))


def test_the_situations_are_what_their_names_say(situation, request):
    path, theta, offset = situation
    motion = tool_motion(path, theta, np.asarray(offset), np.random.default_rng(1))
    rows, point = jets_of_outputs(path, theta, motion)
    alpha = point[2]
    name = request.node.callspec.params["situation"]
    expected = {"circle, alpha one half": 0.5, "straight": 0.0}.get(name)
    assert expected is None or abs(alpha - expected) < 1e-12
    assert rows.shape == (ORDER + 1, 6 if path.orientation is not None else 3)
    assert np.abs(rows[1:]).max() > 0.05


@pytest.mark.slow(but=["lemniscate", "oriented"])
def test_lower_orders_are_the_beginning_of_higher_ones(situation):
    path, theta, offset = situation
    motion = tool_motion(path, theta, np.asarray(offset), np.random.default_rng(3))
    full, _ = jets_of_outputs(path, theta, motion)
    for order in range(1, ORDER):
        rows, _ = jets_of_outputs(path, theta, motion, order)
        assert np.allclose(rows, full[: order + 1], rtol=1e-12, atol=1e-12)


def test_orientation_error_is_singular_only_at_a_quarter_turn(oriented_path):
    """Large errors about one axis come out as they went in."""
    theta = 1.3
    sigma = oriented_path.position.derivatives(theta, 0)[0]
    R_d = quaternion_to_matrix(oriented_path.orientation.derivatives(theta, 0)[0])
    point = oriented_path.evaluator(1).evaluate_at(theta)
    layout = oriented_path.evaluator(1).layout
    geometry = PathGeometry(
        ca.SX(point[layout.eta]),
        ca.SX(point[layout.normal]),
        [ca.SX(row) for row in point[layout.position].reshape(-1, 3)],
        # the norm of the quaternion must not matter
        [7.0 * ca.SX(row) for row in point[layout.quaternion].reshape(-1, 4)],
    )
    zero = ca.SX(3, 1)
    for angles in ([3.0, 0.2, -0.1], [0.1, 1.5, 0.3], [-0.4, -1.4, -2.9]):
        R_e = ca.SX(R_d @ Rotation.from_euler("ZYX", angles).as_matrix())
        y = Jet([ca.SX(sigma), zero])
        outputs = path_coordinates(y, Jet([R_e, ca.SX(3, 3)]), geometry)
        phi = [float(ca.evalf(output.coefficients[0])) for output in outputs[3:]]
        assert np.allclose(phi, angles, rtol=0, atol=1e-12)


def euler_rate_matrix(phi):
    """T_ZYX (2.21): angular velocity, in axes that do not turn, from the rates of the angles."""
    a, b = phi[:2]
    return np.array(
        [
            [0.0, -np.sin(a), np.cos(a) * np.cos(b)],
            [0.0, np.cos(a), np.sin(a) * np.cos(b)],
            [1.0, 0.0, -np.sin(b)],
        ]
    )


def test_decoupling_matrix_is_the_path_jacobian(load_robot, oriented_path):
    """A = L_p J (3.22) with Drake's Jacobian; the angles' rows by (3.37), angles of R_d' R_e."""
    robot = load_robot("comau_racer_1_4")
    theta = 1.1
    curve, orientation = oriented_path.position, oriented_path.orientation
    R_d = quaternion_to_matrix(orientation.derivatives(theta, 0)[0])
    R_e = R_d @ Rotation.from_euler("ZYX", [0.2, -0.1, 0.15]).as_matrix()
    q = robot.reach(curve.derivatives(theta, 0)[0] + [0.01, 0.02, -0.015], R_e)
    y_t, R_e = robot.tool_pose(np.concatenate([q, np.zeros(6)]))
    point = oriented_path.evaluator(2)(y_t.tolist(), theta)
    theta, _, alpha = point[:3]

    sigma, slope, bend = curve.derivatives(theta, 2)
    speed = np.linalg.norm(slope)
    assert np.isclose(alpha, (y_t - sigma) @ bend / speed**2, rtol=1e-12)
    e_par, e_perp = slope / speed, oriented_path.frame.normals(theta)[0]
    E_p = np.array([e_par / (1.0 - alpha), e_perp, np.cross(e_par, e_perp)])
    J = robot.jacobian(q)
    J_w, J_t = J[:3], J[3:]

    def rotation(s):
        return quaternion_to_matrix(orientation.derivatives(s, 0)[0])

    h = 1e-3
    slope_R = (8 * (rotation(theta + h) - rotation(theta - h))) / (12 * h)
    slope_R -= (rotation(theta + 2 * h) - rotation(theta - 2 * h)) / (12 * h)
    R_d = rotation(theta)
    S = slope_R @ R_d.T
    w_d = np.array([S[2, 1], S[0, 2], S[1, 0]])
    theta_rate = e_par @ J_t / (speed * (1.0 - alpha))
    phi = Rotation.from_matrix(R_d.T @ R_e).as_euler("ZYX")
    relative = R_d.T @ (J_w - np.outer(w_d, theta_rate))
    expected = np.vstack([E_p @ J_t, np.linalg.solve(euler_rate_matrix(phi), relative)])

    linearization = linearize(
        robot.chain, "rigid", PathManifold(RELATIVE_DEGREE["rigid"], oriented=True)
    )
    state = np.concatenate([q, np.zeros(6), q, np.zeros(6)])
    A = np.array(linearization.function(state, np.zeros(6), point)[1])
    assert np.allclose(A[:3], expected[:3], rtol=0, atol=1e-11)
    # the differences' step leaves 1e-11
    assert np.allclose(A, expected, rtol=0, atol=1e-9)
