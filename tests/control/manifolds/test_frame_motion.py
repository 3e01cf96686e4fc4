"""Blocks of what carries a manifold, against kinematics by other means."""

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.manifolds.frame_motion import (
    DifferencedFrame,
    FlangeFrame,
    FramedPoint,
    PlannedFrame,
    RelativeTool,
    flange_motion_function,
)
from pfsc_drake.control.manifolds.moving_frame import POSE_SIZE, FramedLayout
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.geometry import zyx_to_matrix
from tests.control.manifolds.tool_motion import NODES, ORDER, assert_derivatives

SMALL = 1e-3  # s


@pytest.fixture
def joints():
    """Joint coordinates of six axes as polynomials of time, rows of derivatives at zero."""
    rng = np.random.default_rng(2)
    rows = rng.uniform(-1.0, 1.0, (ORDER + 1, 6))
    rows[0] = [0.2, 1.6, -0.5, 0.1, 1.2, 0.1]
    return rows


def moved(rows, t):
    """Return the joints at a time."""
    powers = np.array([t**k / np.prod(range(1, k + 1)) for k in range(len(rows))])
    return powers @ rows


def flange(robot, q):
    """Return ``[p, R by rows]`` of the tool by Drake's kinematics."""
    p, R = robot.tool_pose(np.concatenate([q, 0 * q, q, 0 * q]))
    return np.append(p, R)


def output(block, **inputs):
    """Return the only output of a block at rest."""
    values = Stepper(block).step(**inputs)
    return next(iter(values.values()))


def test_a_flange_moves_as_drake_says(load_robot, joints):
    robot = load_robot("comau_racer_1_4")
    known = output(FlangeFrame(robot.chain, ORDER, ORDER), joint_jet=joints.ravel())
    samples = np.array([flange(robot, moved(joints, t)) for t in NODES])
    assert_derivatives(known.reshape(ORDER + 1, POSE_SIZE), samples)


def test_a_base_with_another_nominal_pose(load_robot, joints):
    robot, R = load_robot("comau_racer_1_4"), zyx_to_matrix([0.02, -0.01, 0.03])
    p = np.array([1e-3, -2e-3, 5e-4])
    block = FlangeFrame(robot.chain, ORDER, 2, np.append(p, R))
    known = output(block, joint_jet=joints.ravel()).reshape(3, POSE_SIZE)
    true = output(FlangeFrame(robot.chain, ORDER, 2), joint_jet=joints.ravel()).reshape(3, -1)
    for k in range(3):
        position = R @ true[k, :3] + (p if k == 0 else 0.0)
        assert np.allclose(known[k, :3], position, rtol=0, atol=1e-14)
        rotation = R @ true[k, 3:].reshape(3, 3)
        assert np.allclose(known[k, 3:], rotation.ravel(), rtol=0, atol=1e-14)


def test_omitted_derivatives_are_zero(load_robot, joints):
    robot = load_robot("comau_racer_1_4")
    whole = output(FlangeFrame(robot.chain, ORDER, 3), joint_jet=joints.ravel())
    part = output(FlangeFrame(robot.chain, ORDER, 3, highest=1), joint_jet=joints.ravel())
    assert np.array_equal(part[: 2 * POSE_SIZE], whole[: 2 * POSE_SIZE])
    assert not part[2 * POSE_SIZE :].any() and whole[2 * POSE_SIZE :].any()


def test_differences_are_those_of_the_last_ticks(load_robot, joints):
    """Of order k, that of k / 2 ticks ago; at the start the frame rests."""
    robot = load_robot("comau_racer_1_4")
    function, times = flange_motion_function(robot.chain, 2), SMALL * np.arange(-6, 1)
    block = Stepper(DifferencedFrame(2, 2, SMALL))
    known = []
    for t in times:
        rows = [moved(joints[k:], t) for k in range(3)]
        frame = np.array(function(np.concatenate(rows))).ravel()
        known.append(block.step(frame_jet=frame)["differenced"].reshape(3, POSE_SIZE).copy())
    assert not known[0][1:].any()
    for k in (1, 2):
        middle = times[-1] - k * SMALL / 2.0
        rows = [moved(joints[i:], middle) for i in range(3)]
        expected = np.array(function(np.concatenate(rows))).reshape(3, POSE_SIZE)[k]
        # what is left is of second order in the step
        assert np.abs(known[-1][k] - expected).max() < 5e-6
    for before, now in pairwise(known):
        assert np.allclose(now[1], (now[0] - before[0]) / SMALL, rtol=0, atol=1e-12)


def test_differences_above_the_highest_are_zero():
    frame, block = np.arange(36.0), Stepper(DifferencedFrame(2, 1, SMALL))
    block.step(frame_jet=frame)
    known = block.step(frame_jet=frame + 1.0)["differenced"]
    assert np.allclose(known[POSE_SIZE : 2 * POSE_SIZE], 1.0 / SMALL) and not known[24:].any()


@pytest.mark.parametrize("highest", [0, 1, 4])
def test_a_plan_tells_the_derivatives_of_a_measured_pose(highest):
    measured, planned = np.arange(36.0), -np.arange(1.0, 37.0)
    known = output(PlannedFrame(2, highest), frame_jet=measured, planned=planned).reshape(3, -1)
    assert np.array_equal(known[0], measured[:POSE_SIZE])
    last = min(highest, 2)
    assert np.array_equal(known[1 : last + 1], planned.reshape(3, -1)[1 : last + 1])
    assert not known[last + 1 :].any()


def test_a_tool_in_a_frame():
    R_WC, R_e = zyx_to_matrix([0.3, 0.2, -0.4]), zyx_to_matrix([-0.1, 0.5, 0.2])
    p, y = np.array([0.3, -0.2, 0.5]), np.array([0.7, 0.1, 0.9])
    frame = np.concatenate([p, R_WC.ravel(), np.full(12, np.nan)])
    relative_pose = output(RelativeTool(1), tool_pose=np.append(y, R_e), frame_jet=frame)
    assert np.allclose(relative_pose[:3], R_WC.T @ (y - p), rtol=0, atol=1e-15)
    assert np.allclose(relative_pose[3:].reshape(3, 3), R_WC.T @ R_e, rtol=0, atol=1e-15)


def test_a_point_with_its_frame():
    layout = FramedLayout(PathManifold(1, oriented=False).layout)
    point, frame = np.arange(float(layout.own.size)), -np.arange(24.0)
    framed = output(FramedPoint(layout), manifold_point=point, frame_jet=frame)
    assert np.array_equal(framed, np.append(point, frame))
    assert np.array_equal(framed[layout.frame], frame)


def test_the_motion_of_a_flange_may_be_of_any_order(load_robot, joints):
    robot = load_robot("comau_racer_1_4")
    low, high = (
        np.array(flange_motion_function(robot.chain, k)(ca.DM(joints[: k + 1].ravel()))).ravel()
        for k in (1, 3)
    )
    assert np.allclose(high[: 2 * POSE_SIZE], low, rtol=0, atol=1e-14)
