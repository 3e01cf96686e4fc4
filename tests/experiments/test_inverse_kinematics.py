"""Closed-form postures against Drake's kinematics of the shipped model."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from experiments.cli import main
from experiments.inverse_kinematics import find_postures
from pfsc_drake.robot.models.files import resolve_model

COMAU = "comau_racer_1_4"
POSE = ["--position", "0.83", "0", "0.9", "--zyx-deg", "180", "-45", "0"]


class Arm:
    """The shipped model as Drake reads it."""

    def __init__(self) -> None:
        self.plant = MultibodyPlant(0.0)
        Parser(self.plant).AddModels(resolve_model(COMAU))
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()

    def pose(self, q, frame="tool_point") -> RigidTransform:
        self.plant.SetPositions(self.context, q)
        return self.plant.GetFrameByName(frame).CalcPoseInWorld(self.context)


@pytest.fixture(name="arm", scope="module")
def fixture_arm():
    return Arm()


def postures_like(arm, q):
    X = arm.pose(q)
    zyx_deg = np.rad2deg(RollPitchYaw(X.rotation()).vector()[::-1])
    return X, find_postures(COMAU, X.translation(), zyx_deg)


@pytest.mark.parametrize("seed", range(4))
def test_all_postures_reach_the_pose_and_are_what_they_are_called(arm, seed):
    middle = np.array([0.0, 1.0, 0.0, 0.0, 0.5, 0.0])
    q = middle + np.random.default_rng(seed).uniform(-1.0, 1.0, 6)
    X, postures = postures_like(arm, q)
    found = np.array([posture.branch.q for posture in postures])
    off = np.abs((found - q + np.pi) % (2 * np.pi) - np.pi).max(axis=1)
    assert off.min() < 1e-9
    names = {(p.branch.shoulder, p.branch.elbow, p.branch.wrist) for p in postures}
    assert len(names) == len(postures) in (4, 8)
    lower, upper = arm.plant.GetPositionLowerLimits(), arm.plant.GetPositionUpperLimits()
    for posture in postures:
        branch = posture.branch
        assert arm.pose(branch.q).IsNearlyEqualTo(X, 1e-11)
        assert posture.miss < 1e-12 and posture.turn < 1e-11
        shoulder, elbow, wrist_centre = (
            arm.pose(branch.q, f"link_{i}").translation() for i in (1, 2, 4)
        )
        forward = arm.pose(branch.q, "link_1").rotation().matrix()[:, 0]
        assert (forward @ wrist_centre > 0.0) == (branch.shoulder == "front")
        line = (wrist_centre - shoulder) / np.linalg.norm(wrist_centre - shoulder)
        height = (elbow - shoulder) - line * (line @ (elbow - shoulder))
        assert (height[2] > 0.0) == (branch.elbow == "up")
        assert (branch.q[4] > 0.0) == (branch.wrist == "positive")
        within = np.all((branch.q >= lower) & (branch.q <= upper))
        assert within == branch.is_within_limits
        beyond = np.maximum(lower - branch.q, branch.q - upper)
        np.testing.assert_allclose(branch.violation, np.maximum(beyond, 0.0), atol=1e-12)


def test_a_straight_wrist_flips_to_itself(arm):
    _, postures = postures_like(arm, [0.2, 1.3, -0.3, 0.0, 0.0, 0.4])
    assert [posture.branch.wrist for posture in postures].count("straight") == 1
    assert len(postures) == 7
    assert max(posture.miss for posture in postures) < 1e-9


def test_a_wrist_centre_above_the_shoulder_leaves_it_open():
    # a tool that points up, 0.2 m and more above the wrist centre on axis 1
    postures = find_postures(COMAU, np.array([0.0, 0.0, 1.5]), np.zeros(3))
    assert {posture.branch.shoulder for posture in postures} == {"open"}
    assert max(posture.miss for posture in postures) < 1e-9


def test_the_command_prints_a_row_for_each(capsys):
    assert main(["inverse-kinematics", COMAU, *POSE]) == 0
    header, *rows, last = capsys.readouterr().out.splitlines()
    assert header.split()[:4] == ["Shoulder", "Elbow", "Wrist", "theta_1"]
    assert len(rows) == 8
    first = ["front", "up", "positive", "0.000", "101.749", "-44.722", "0.000", "77.973", "0.000"]
    assert rows[0].split()[:9] == first
    assert "within" in rows[0] and "theta_3 86.8 deg beyond" in rows[2]
    assert last == "2 of 8 within the limits, angles in deg"
    # above the shoulder a whole circle of postures reaches it
    assert (
        main(
            ["inverse-kinematics", COMAU, "--position", "0", "0", "1.5", *POSE[4:5], "0", "0", "0"]
        )
        == 0
    )
    assert capsys.readouterr().out.splitlines()[-1] == (
        "theta_1 of an open shoulder and theta_4 of a straight wrist are free: 0 stands for all"
    )


@pytest.mark.parametrize(
    ("model", "position", "part"),
    [
        (COMAU, "3", "must be 0.1062 to 1.2862 m"),
        (COMAU, "nan", "y_t = [nan, 0.0, 0.9]: must be finite"),
        ("franka_emika_panda", "0.5", "franka_emika_panda has no closed form"),
        ("scara_600", "0.5", "robot 'scara_600': must be a file or one of comau_racer_1_4"),
        ("festo_expt_45", "0.5", "robot 'festo_expt_45': must be"),
    ],
)
def test_refused_in_one_line(capsys, model, position, part):
    pose = ["--position", position, *POSE[2:]]
    assert main(["inverse-kinematics", model, *pose]) == 2
    line = capsys.readouterr().err
    assert line.startswith("error: ") and line.count("\n") == 1
    assert part in line
