"""Distances between samples."""

import numpy as np
import pytest

from identification.excitation import swept_clearance as swept_clearance_module
from identification.excitation.fourier import FourierTrajectory
from identification.excitation.scene import Cell, Obstacle, RobotScene
from identification.excitation.swept_clearance import swept_clearance


@pytest.mark.slow
def test_nothing_is_nearer_than_guaranteed(comau, comau_scene, printed):
    swept = swept_clearance(comau.chain, comau_scene, printed, 0.02)
    t = np.random.default_rng(0).uniform(0.0, 10.0, 300)
    dense = comau_scene.distances(printed.motion(t)[0]).min()
    assert swept.guaranteed <= swept.least <= dense + 1e-3
    assert swept.guaranteed <= dense


@pytest.fixture(scope="module")
def thin_wall(arm):
    """A scene with a plate as thin as a sheet of paper, that the arm sweeps through."""
    q_0 = arm.position_limits.mean(axis=1)
    wall = Obstacle(
        name="sheet", kind="box", center=np.array([1.2, 0.0, 1.0]), size=np.array([4.0, 1e-4, 4.0])
    )
    return RobotScene(arm, Cell([wall], self_collision=False)), q_0


@pytest.fixture(scope="module")
def far_wall(arm):
    """A scene with a sheet that begins 0.8 m before the first joint's axis."""
    wall = Obstacle(
        name="sheet", kind="box", center=np.array([1.6, 0.0, 1.0]), size=np.array([1.6, 1e-4, 4.0])
    )
    return RobotScene(arm, Cell([wall], self_collision=False))


def test_distance_of_a_motion_away_from_a_wall(arm, far_wall):
    """The first joint swings around 1.2 rad, away from the plane y = 0."""
    a = np.zeros((3, 1))
    a[0] = 0.5
    q_0 = np.array([1.2, *arm.position_limits.mean(axis=1)[1:]])
    motion = FourierTrajectory(q_0, a, np.zeros((3, 1)), 2.0 * np.pi, (1,))
    swept = swept_clearance(arm.chain, far_wall, motion, 0.02)
    extremes = far_wall.distances(motion.motion(np.array([np.pi / 2, -np.pi / 2]))[0])
    assert swept.least == pytest.approx(extremes.min(), abs=1e-3)
    # far more than is asked for: it is known without a closer look
    assert 0.1 < swept.guaranteed <= swept.least
    assert swept.instants == 401
    # what is asked for to a hundredth of a millimetre is known as well
    requested = swept_clearance(arm.chain, far_wall, motion, swept.least - 1e-5, 1e-5)
    assert requested.least - 2e-5 <= requested.guaranteed <= requested.least
    assert 0 < requested.instants - swept.instants < 100


def test_finds_what_happens_between_coarse_samples(arm, thin_wall, monkeypatch):
    scene, q_0 = thin_wall
    a = np.zeros((3, 1))
    a[0] = 2.0  # from one side of the sheet to the other
    motion = FourierTrajectory(q_0, a, np.zeros((3, 1)), 2.0 * np.pi, (1,))
    swept = swept_clearance(arm.chain, scene, motion, 0.02)
    assert swept.least < 0.02
    assert swept.guaranteed < 0.018
    assert "sheet" in swept.pair


def test_robot_with_nothing_to_touch(arm, printed):
    scene = RobotScene(arm, Cell(self_collision=False))
    motion = FourierTrajectory(np.zeros(3), np.ones((3, 1)), np.ones((3, 1)), 5.0, (1,))
    swept = swept_clearance(arm.chain, scene, motion, 0.02)
    assert (swept.least, swept.guaranteed, swept.pair) == (np.inf, np.inf, "")


def test_finds_what_happens_between_instants_of_rest(arm, far_wall, monkeypatch):
    """The arm rests at all instants that are looked at first, on either side of the sheet."""
    monkeypatch.setattr(swept_clearance_module, "_INSTANTS", 2)
    scene, q_0 = far_wall, arm.position_limits.mean(axis=1)
    b = np.zeros((3, 1))
    b[0] = 1.2
    motion = FourierTrajectory(q_0, np.zeros((3, 1)), b, 2.0 * np.pi, (1,))
    rest = np.array([0.0, np.pi])
    assert np.abs(motion.motion(rest)[1]).max() < 1e-12
    assert scene.distances(motion.motion(rest)[0]).min() > 0.2
    swept = swept_clearance(arm.chain, scene, motion, 0.02)
    dense = scene.distances(motion.motion(np.linspace(0.0, 2.0 * np.pi, 500))[0]).min()
    assert swept.guaranteed <= dense + 1e-9
    assert swept.least < 0.02 and "sheet" in swept.pair


@pytest.mark.parametrize("harmonics", [(1,), (8,), (1, 4)])
def test_nothing_falls_below_its_bound_between_two_instants(harmonics):
    """A distance that is a joint's coordinate, from one rest to the next and otherwise."""
    random = np.random.default_rng(len(harmonics))
    a, b = random.normal(size=(2, 1, len(harmonics)))
    motion = FourierTrajectory(np.zeros(1), a, b, 2.0, harmonics)
    left = np.linspace(0.0, 1.9, 100)
    for length in (0.01, 0.1, 0.25):
        right = left + length
        at_left, at_right = motion.motion(left)[0], motion.motion(right)[0]
        bound = swept_clearance_module._between(
            motion, left, right, at_left, at_right, np.ones((1, 1))
        )[:, 0]
        between = left[:, None] + length * np.linspace(0.0, 1.0, 50)
        lowest = motion.motion(between.ravel())[0].reshape(between.shape).min(axis=1)
        assert np.all(bound <= lowest + 1e-12)
        if length == 0.01:
            assert np.all(bound >= lowest - 0.1 * np.abs(a).sum())


def test_no_pair_comes_nearer_than_its_joints_allow(arm):
    """The farthest point of a shape counts, and its own joint; 3 mm are the engine's."""
    walls = [
        Obstacle(name=name, kind="box", center=np.array(center), size=np.full(3, 0.1))
        for name, center in (("above", [0.5, 0.0, 2.9]), ("ahead", [2.3, 0.3, 0.9]))
    ]
    scene = RobotScene(arm, Cell(walls, self_collision=False))
    low, high = arm.position_limits.T
    postures = np.random.default_rng(1).uniform(low, high, (60, 3))
    weights = swept_clearance_module._reach_between(arm.chain, scene, postures)
    for j, shift in enumerate(0.05 * np.eye(3)):
        travel = np.abs(scene.distances(postures + shift) - scene.distances(postures - shift))
        assert np.all(travel <= 0.1 * weights[:, j] + 3e-3)
        assert travel.max() > 0.08 * weights[:, j].max()
