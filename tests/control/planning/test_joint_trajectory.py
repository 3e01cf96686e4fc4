"""Joint trajectories of a tool that follows exactly, against Drake's kinematics."""

from dataclasses import replace

import numpy as np
import pytest

from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.law.reference import rest_to_rest
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.control.planning.joint_trajectory import TrajectoryFinder, TrajectoryStart
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import quaternion_to_matrix

STEP = 1e-3


def find(robot, law, path, times, start, frames=None):
    """Return a trajectory along a path, and the arc lengths; at rest on a path that moves."""
    order = RELATIVE_DEGREE["elastic"]
    manifold = PathManifold(order, oriented=path.orientation is not None)
    evaluator = path.evaluator(order)
    finder = TrajectoryFinder(
        robot.chain,
        manifold,
        lambda y_t, memory: evaluator(y_t.tolist(), memory[0]),
        law.inverse,
        law.posture,
        in_moving_frame=frames is not None,
    )
    eta = rest_to_rest([0.3, 0.45], velocity=1.0, acceleration=8.0)
    reference = np.zeros((len(times), order + 1, len(manifold.coordinates)))
    reference[:, :, 0] = eta.derivatives(times, order)[:, :, 0]
    if frames is not None:
        reference[:] = reference[0]
    begin = TrajectoryStart(start, np.array([path.arc_length.parameter(0.3)]))
    return finder.find(begin, reference, times, frames=frames), reference[:, 0, 0]


def check(robot, path, trajectory, eta, tolerance=1e-4):
    """The tool is on the path at its arc length, and derivatives are derivatives."""
    n = robot.n
    for q, s in zip(trajectory[::40, 0], eta[::40], strict=True):
        y_t, R_e = robot.tool_pose(np.concatenate([q, np.zeros(n), q, np.zeros(n)]))
        theta = path.arc_length.parameter(s)
        assert np.allclose(y_t, path.position.derivatives(theta, 0)[0], rtol=0, atol=1e-9)
        if path.orientation is not None:
            R_d = quaternion_to_matrix(path.orientation.derivatives(theta, 0)[0])
            assert np.allclose(R_e, R_d, rtol=0, atol=1e-8)
    for k in range(trajectory.shape[1] - 1):
        slope = np.array([1.0, -8.0, 8.0, -1.0]) @ trajectory[[18, 19, 21, 22], k] / (12.0 * STEP)
        scale = np.abs(trajectory[:, k + 1]).max()
        assert np.allclose(trajectory[20, k + 1], slope, rtol=0, atol=tolerance * scale)


@pytest.mark.slow
def test_six_axes(load_robot, make_law, oriented_path):
    robot = load_robot("comau_racer_1_4_elastic")
    law = make_law(robot.chain, "elastic")
    rigid = load_robot("comau_racer_1_4")
    theta = oriented_path.arc_length.parameter(0.3)
    y_t = oriented_path.position.derivatives(theta, 0)[0]
    near = rigid.reach(y_t) + 0.01
    trajectory, eta = find(robot, law, oriented_path, np.arange(0.0, 0.15, STEP), near)
    check(robot, oriented_path, trajectory, eta)


def test_tool_at_rest_moves_with_the_frame_of_its_path(load_robot, make_law, oriented_path):
    """The frame rests for 20 ms, then translates by 40 mm along y."""
    robot = load_robot("comau_racer_1_4_elastic")
    law = make_law(robot.chain, "elastic")
    y_0 = oriented_path.position.derivatives(oriented_path.arc_length.parameter(0.3), 0)[0]
    near = load_robot("comau_racer_1_4").reach(y_0) + 0.01
    times = np.arange(0.0, 0.1, 4e-3)
    travel = np.polynomial.Polynomial([0.0] * 5 + [0.04 / 0.08**5])
    frames = np.zeros((len(times), 5, 12))
    frames[:, 0, 3:] = np.eye(3).ravel()
    for k in range(5):
        frames[:, k, 1] = np.where(times > 0.02, travel.deriv(k)(times - 0.02), 0.0)
    frames = frames.reshape(len(times), -1)
    trajectory, _ = find(robot, law, oriented_path, times, near, frames)
    for q, p in zip(trajectory, frames[:, :3], strict=True):
        y_t, _ = robot.tool_pose(np.concatenate([q[0], 0 * q[0], q[0], 0 * q[0]]))
        assert np.allclose(y_t, y_0 + p, rtol=0, atol=1e-9)
    assert not trajectory[:5, 1:].any() and np.abs(trajectory[-1, 1]).max() > 0.5


def test_redundant_joints_follow_the_posture_task(load_robot, make_law, position_path):
    robot = load_robot("comau_racer_1_4_elastic")
    law = make_law(robot.chain, "elastic", False)
    rigid = load_robot("comau_racer_1_4")
    theta = position_path.arc_length.parameter(0.3)
    start = rigid.reach(position_path.position.derivatives(theta, 0)[0])
    trajectory, eta = find(robot, law, position_path, np.arange(0.0, 0.2, STEP), start)
    # null-space motion is constant between samples, as under a sampled law
    check(robot, position_path, trajectory, eta, 0.03)


@pytest.mark.slow(but="velocity_servo-weight0")
@pytest.mark.parametrize("weight", [np.array([1.0, 2.0, 1.0, 0.5, 1.0, 3.0]), None])
@pytest.mark.parametrize("name", ["rigid", "velocity_servo"])
def test_posture_task_is_restrained_above_ratio_one(
    name, weight, load_robot, make_law, position_path
):
    """Up to a ratio of 1 the drive torques equal those of a law without restraint."""
    robot, order = load_robot("comau_racer_1_4"), RELATIVE_DEGREE[name]
    speeds = np.array([1.0, 2.0, 3.0, 2.0, 1.5, 1.0])
    free = make_law(robot.chain, name, False, weight=weight)

    def restrained_above(speeds):
        return make_law(robot.chain, name, False, posture=replace(free.posture, speeds=speeds))

    law, evaluator = restrained_above(speeds), position_path.evaluator(order)
    theta = position_path.arc_length.parameter(0.3)
    q_0 = robot.reach(position_path.position.derivatives(theta, 0)[0])
    finder = TrajectoryFinder(
        robot.chain,
        PathManifold(order, oriented=False),
        lambda y_t, memory: evaluator(y_t.tolist(), memory[0]),
        law.inverse,
        law.posture,
    )
    times = np.arange(0.0, 0.25, 5e-3)
    reference = np.zeros((len(times), order + 1, 3))
    eta = rest_to_rest([0.3, 0.5], velocity=1.0, acceleration=8.0)
    reference[:, :, 0] = eta.derivatives(times, order)[:, :, 0]
    start = TrajectoryStart(q_0, np.array([theta]))
    trajectory = finder.find(start, reference, times)
    shares = finder.restraint_ratio(start, trajectory, reference)
    assert shares[0].max() < 1e-6
    for i in (10, 25, 40):
        y_t, _ = robot.tool_pose(np.concatenate([trajectory[i, 0]] * 2))
        point = evaluator(y_t.tolist(), position_path.nearest(y_t))
        state = np.tile(trajectory[i, :2].ravel(), 2)
        inputs = reference[i].ravel(), np.zeros(3)
        posture = np.concatenate([q_0, np.zeros(6 * order)])
        drives = []
        for share in (np.inf, 1.001, 0.99):
            tried = restrained_above(share * shares[i].max() * speeds)
            result = tried.evaluate(state, point, *inputs, posture=posture)
            drives.append(result[tried.layout.drive])
        scale = np.abs(drives[0]).max()
        assert np.allclose(drives[1], drives[0], rtol=0, atol=1e-9 * scale)
        assert np.abs(drives[2] - drives[0]).max() > 1e-6 * scale


def test_points_out_of_reach_are_rejected(load_robot, make_law, position_path):
    robot = load_robot("comau_racer_1_4_elastic_3r")
    law = make_law(robot.chain, "elastic", False)
    with pytest.raises(InputError):
        find(robot, law, _Moved(position_path), np.arange(0.0, 0.01, STEP), np.zeros(3))


class _Moved:
    """A path that is moved by ten metres."""

    def __init__(self, path):
        self.orientation, self.arc_length = None, path.arc_length
        self._evaluator = path.evaluator

    def evaluator(self, order):
        evaluate = self._evaluator(order)

        def moved(y_t, theta):
            point = evaluate((np.array(y_t) - 10.0).tolist(), theta).copy()
            point[7:10] += 10.0
            return point

        return moved
