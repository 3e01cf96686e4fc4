"""Distances between samples."""

import numpy as np
import pytest

from identification.excitation import swept_clearance as swept_clearance_module
from identification.excitation.fourier import FourierTrajectory
from identification.excitation.scene import Cell, Obstacle, RobotScene
from identification.excitation.swept_clearance import swept_clearance


def test_nothing_is_nearer_than_guaranteed(comau, comau_scene, printed):
    swept = swept_clearance(comau.chain, comau_scene, printed, 0.02)
    t = np.random.default_rng(0).uniform(0.0, 10.0, 300)
    dense = comau_scene.clearance(printed.motion(t)[0])
    assert swept.guaranteed <= swept.least <= dense.least + 1e-3
    assert swept.guaranteed <= dense.least


@pytest.fixture(scope="module")
def thin_wall(arm):
    """A scene with a plate as thin as a sheet of paper, that the arm sweeps through."""
    q_0 = arm.position_limits.mean(axis=1)
    wall = Obstacle(
        name="sheet", kind="box", center=np.array([1.2, 0.0, 1.0]), size=np.array([4.0, 1e-4, 4.0])
    )
    return RobotScene(arm, Cell([wall], self_collision=False)), q_0


def test_distance_of_a_motion_away_from_a_wall(arm, thin_wall):
    scene, q_0 = thin_wall
    # the first joint swings around 1.2 rad, away from the plane y = 0
    a = np.zeros((3, 1))
    a[0] = 0.5
    q_0 = np.array([1.2, *q_0[1:]])
    motion = FourierTrajectory(q_0, a, np.zeros((3, 1)), 2.0 * np.pi, (1,))
    swept = swept_clearance(arm.chain, scene, motion, 0.02)
    extremes = [
        scene.clearance(motion.motion(np.array([t]))[0]).least for t in (np.pi / 2, -np.pi / 2)
    ]
    assert swept.least == pytest.approx(min(extremes), abs=1e-3)
    assert swept.guaranteed >= 0.018 or swept.least < 0.02


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


def test_finds_what_happens_between_instants_of_rest(arm, monkeypatch):
    """The arm rests at all instants that are looked at first, on either side of the sheet."""
    monkeypatch.setattr(swept_clearance_module, "_INSTANTS", 2)
    wall = Obstacle(
        name="sheet", kind="box", center=np.array([1.6, 0.0, 1.0]), size=np.array([1.6, 1e-4, 4.0])
    )
    scene = RobotScene(arm, Cell([wall], self_collision=False))
    q_0 = arm.position_limits.mean(axis=1)
    b = np.zeros((3, 1))
    b[0] = 1.2
    motion = FourierTrajectory(q_0, np.zeros((3, 1)), b, 2.0 * np.pi, (1,))
    rest = np.array([0.0, np.pi])
    assert np.abs(motion.motion(rest)[1]).max() < 1e-12
    assert scene.clearance(motion.motion(rest)[0]).least > 0.2
    swept = swept_clearance(arm.chain, scene, motion, 0.02)
    dense = scene.clearance(motion.motion(np.linspace(0.0, 2.0 * np.pi, 500))[0]).least
    assert swept.guaranteed <= dense + 1e-9
    assert swept.least < 0.02 and "sheet" in swept.pair
