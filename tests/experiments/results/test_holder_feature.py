"""Signals of a workpiece that moves, from made-up motions."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from experiments.results.holder_feature import frame_error, holder_metrics, relative_poses
from experiments.results.run_log import RunLog
from pfsc_drake.geometry.rotation import placed_points


def pose(position, rotvec):
    """Return ``[p, R by rows]``."""
    return np.append(position, Rotation.from_rotvec(rotvec).as_matrix())


@pytest.fixture
def motions():
    rng = np.random.default_rng(1)
    return [
        np.array([pose(p, w) for p, w in zip(*rng.uniform(-1, 1, (2, 5, 3)), strict=True)])
        for _ in range(2)
    ]


def test_what_is_seen_is_where_it_was_placed(motions):
    tool, frames = motions
    seen = relative_poses(tool, frames)
    assert np.allclose(placed_points(seen[:, :3], frames), tool[:, :3], rtol=0, atol=1e-14)
    turned = frames[:, 3:].reshape(-1, 3, 3) @ seen[:, 3:].reshape(-1, 3, 3)
    assert np.allclose(turned.reshape(-1, 9), tool[:, 3:], rtol=0, atol=1e-14)


def test_of_no_samples_nothing_is_seen():
    assert relative_poses(np.zeros((0, 12)), np.zeros((0, 36))).shape == (0, 12)


@pytest.mark.parametrize("angle", [1e-9, 1e-3, 2.0])
def test_how_far_a_frame_is_off(angle):
    """Small turns keep their digits."""
    turn = angle * np.array([0.6, 0.0, 0.8])
    true, believed = pose([0.1, 0.2, 0.3], [0.0, 0.0, 0.0]), pose([0.1, 0.2, 0.3004], turn)
    (off,) = frame_error(believed[None], true[None])
    assert off == pytest.approx([4e-4, angle], rel=1e-6)


def test_metrics_of_a_workpiece_that_turns():
    """At 2 rad/s about z, while its origin moves at 0.3 m/s."""
    time = np.linspace(0.0, 1.0, 1001)
    log = RunLog(time)
    poses = [pose([0.3 * t, 0.0, 0.5], [0.0, 0.0, 2.0 * t]) for t in time]
    log.add("workpiece_pose", poses)
    log.add("y_t_world", np.outer(time, [0.0, 0.4, 0.0]))
    log.add("holder_xi", np.where(time[:, None] < 0.2, 1.0, 2e-5 * np.ones((1, 2))))
    log.add("frame_error", np.outer(np.ones(1001), [3e-4, 1e-4]))
    log.add("holder_tau_d", np.outer(np.sin(9.0 * time), [5.0, -7.0]))
    metrics = {name: metric.value for name, metric in holder_metrics(log, 0.3).items()}
    assert metrics["peak_workpiece_speed"] == pytest.approx(0.3, rel=1e-9)
    assert metrics["peak_workpiece_turning"] == pytest.approx(2.0, rel=1e-6)
    assert metrics["peak_tool_speed_world"] == pytest.approx(0.4, rel=1e-9)
    assert metrics["max_workpiece_deviation"] == pytest.approx(np.sqrt(2.0) * 2e-5)
    assert metrics["max_frame_error"] == 3e-4 and metrics["max_frame_angle"] == 1e-4
    assert metrics["peak_holder_torque_2"] == pytest.approx(7.0, rel=1e-3)


def test_of_one_robot_there_are_none():
    assert not dict(holder_metrics(RunLog(np.linspace(0.0, 1.0, 11)), 0.0))
