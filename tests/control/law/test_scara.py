"""A four-axis arm against Drake, and its closed loop under every law: position and one turn."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pfsc_drake.control.law.actuation import joint_jets
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.law.linearization import decoupling_function
from pfsc_drake.control.manifolds.manifold import manifold_force_function
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.geometry import (
    FourierCurve,
    Path,
    interpolate_orientation,
    quaternion_to_matrix,
    zyx_to_quaternion,
)
from pfsc_drake.robot.inverse_kinematics import ToolTarget, solve_pose
from pfsc_drake.robot.robot_model import pose_function
from tests.control.law.closed_loop import (
    ClosedLoop,
    assert_linear_dynamics,
    rest_of_state,
    simulate,
)

MODEL, BENT = "scara_600", np.array([-0.3, 1.3, -0.03, -0.6])
STIFFNESS = (2e4, 1e4, 2e6, 400.0)
VERTICAL = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module", name="path")
def fixture_path():
    """A tilted circle; the tool points down, and turns by 270 deg and back."""
    theta = np.linspace(0.0, 2.0 * np.pi, 17)
    angles = np.stack([0.4 + 2.4 * np.sin(theta), 0 * theta, 0 * theta + np.pi], axis=1)
    orientation = interpolate_orientation(
        zyx_to_quaternion(angles), theta, smoothness=5, closed=True
    )
    return Path(FourierCurve.circle([0.36, 0.05, 0.12], 0.12, [1, 0, 0.25], [0, 1, 0]), orientation)


def test_kinematics_and_torques_are_drakes(load_robot):
    robot, rng = load_robot(MODEL), np.random.default_rng(5)
    chain = robot.chain
    assert [link.kind for link in chain.links] == ["revolute", "revolute", "prismatic", "revolute"]
    pose = pose_function(chain)
    for _ in range(5):
        q, v, a = rng.uniform(-1.5, 1.5, (3, 4))
        q[2] *= 0.05
        y_t, R_e = robot.tool_pose(np.concatenate([q, v]))
        np.testing.assert_allclose(np.array(pose(q)).ravel()[:3], y_t, rtol=0, atol=1e-14)
        np.testing.assert_allclose(np.array(pose(q)).ravel()[3:], R_e.ravel(), rtol=0, atol=1e-14)
        assert R_e[:, 2] == pytest.approx(-VERTICAL, abs=1e-14)
        D_E, n_E = robot.link_dynamics(q, v)
        torque = chain.inverse_dynamics(joint_jets([ca.SX(x) for x in (q, v, a)]))
        found = [float(ca.evalf(tau.coefficients[0])) for tau in torque]
        np.testing.assert_allclose(found, D_E @ a + n_E, rtol=0, atol=1e-12)
        # by hand: the tool's place of a planar arm of two links
        reach = 0.325 * np.exp(1j * q[0]) + 0.275 * np.exp(1j * (q[0] + q[1]))
        assert y_t == pytest.approx([reach.real, reach.imag, 0.18 + q[2]], abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["velocity_servo", "rigid", "visco_elastic", "elastic"])
def test_outputs_obey_the_predicted_linear_dynamics(
    law, load_robot, make_law, virtual_output, path
):
    r, rigid = RELATIVE_DEGREE[law], load_robot(MODEL)
    damping = tuple(5e-3 * np.array(STIFFNESS)) if law == "visco_elastic" else ()
    robot = load_robot(MODEL, damping, (), STIFFNESS) if r > 2 else rigid
    manifold = PathManifold(r, oriented=True, yaw_axis=VERTICAL)
    law_made = make_law(robot.chain, law, manifold=manifold)
    loop, theta = ClosedLoop(robot, path, law_made, 0.7), 0.7
    q = solve_pose(rigid.chain, start(path, theta), BENT, "start")
    times, states = simulate(loop, rest_of_state(robot, rigid, q, loop.size))
    results = [loop.evaluate(t, x) for t, x in zip(times, states, strict=True)]
    assert not any(result[law_made.layout.status][0] for result in results)
    Y = np.array([result[law_made.layout.manifold_state] for result in results])
    v = np.array([result[law_made.layout.virtual_input] for result in results])
    outputs = []
    for x in states:
        y_t, R_e = robot.tool_pose(loop.state(x))
        R_d = path.orientation.rotation_matrix(path.nearest(y_t))
        turn = Rotation.from_matrix(R_e @ R_d.T).as_rotvec()
        assert np.abs(turn[:2]).max() < 1e-7
        outputs.append([*virtual_output(path, y_t, R_e)[:3], turn[2]])
    reference = np.array([loop.reference(t) for t in times])
    assert np.ptp(reference[:, 0, 0]) > 0.05
    assert_linear_dynamics(Y.reshape(len(times), r, 4), v, np.array(outputs), reference)


def start(path, theta):
    """Return where the tool begins: beside the path, and turned."""
    sigma = path.position.derivatives(theta, 0)[0]
    R_d = quaternion_to_matrix(path.orientation.derivatives(theta, 0)[0])
    R_e = Rotation.from_rotvec(0.06 * VERTICAL).as_matrix() @ R_d
    return ToolTarget(sigma + np.array([0.006, -0.005, 0.008]), R_e, yaw_axis=VERTICAL)


def test_virtual_work_with_drakes_jacobian(load_robot, path):
    """``A' tau = J_g' wrench`` for torques about the vertical; others do no work on the arm."""
    robot, rng = load_robot(MODEL), np.random.default_rng(2)
    manifold = PathManifold(2, oriented=True, yaw_axis=VERTICAL)
    target = start(path, 0.7)
    q = solve_pose(robot.chain, target, BENT, "start")
    point = path.evaluator(2)(target.y_t.tolist(), 0.7)
    wrench = rng.uniform(-20.0, 20.0, 6)
    force = manifold_force_function(manifold, with_turning=True)
    tau = np.array(force(wrench, point, [0.0, 0.0, 0.0, 0.06])).ravel()
    A = np.array(decoupling_function(robot.chain, manifold)(q, point))
    assert A.shape == (4, 4)
    joint_torques = robot.jacobian(q).T @ np.concatenate([wrench[3:], wrench[:3]])
    np.testing.assert_allclose(A.T @ tau, joint_torques, rtol=0, atol=1e-10)


def test_the_start_keeps_the_tilt_and_takes_the_turn(load_robot):
    """A target that is tilted against the tool: its rotation is used, its tilt reported."""
    chain = load_robot(MODEL).chain
    there = np.array(pose_function(chain)(BENT)).ravel()
    tilt = Rotation.from_rotvec([0.2, -0.1, 0.0])
    R_d = tilt.as_matrix() @ there[3:].reshape(3, 3)
    target = ToolTarget(there[:3], R_d, yaw_axis=VERTICAL)
    q = solve_pose(chain, target, BENT + np.array([0.1, -0.1, 0.01, 0.4]), "start")
    np.testing.assert_allclose(q, BENT, rtol=0, atol=1e-8)
    assert target.tilt(there[3:].reshape(3, 3)) == pytest.approx(tilt.magnitude(), abs=1e-9)
    turned = ToolTarget(there[:3], there[3:].reshape(3, 3), yaw_axis=VERTICAL)
    assert turned.tilt(there[3:].reshape(3, 3)) == pytest.approx(0.0, abs=1e-7)
    assert turned.num_outputs == 4
