"""Searches for excitations of small robots, and what cannot be searched for."""

import os
import signal
from dataclasses import replace

import numpy as np
import psutil
import pytest

from identification.excitation.criterion import information
from identification.excitation.fourier import FourierTrajectory
from identification.excitation.local_search import LocalSearch, random_start
from identification.excitation.scene import Cell, Obstacle
from identification.excitation.search import SearchOptions, search
from identification.model.base import base_parameters
from identification.model.regressor import Regressor
from identification.model.subject import load_subject
from pfsc_drake.errors import InputError
from reporting.processes import side_by_side

POST = Obstacle(
    name="post", kind="cylinder", start=np.array([0, 1, 0]), end=np.array([0, 1, 1]), radius=0.1
)
CELL = Cell([POST], tool_above=0.3, self_collision=False)
QUICK = SearchOptions(period=5.0, harmonics=(1, 2), starts=2, workers=1, iterations=40)


@pytest.fixture(scope="module")
def result_and_progress(arm):
    progress_reports = []
    found = search(arm, QUICK, cell=CELL, progress=lambda *args: progress_reports.append(args))
    return found, progress_reports


@pytest.fixture(scope="module")
def found(result_and_progress):
    return result_and_progress[0]


@pytest.fixture(scope="module")
def figures(arm):
    regressor = Regressor(arm)
    base = base_parameters(regressor)
    return lambda motion: information(regressor, base, motion)


def test_is_much_better_than_random_motions(found, figures, arm_problem):
    motions = [random_start(arm_problem, np.random.default_rng(i)) for i in range(10)]
    others = [
        figures(FourierTrajectory.from_coefficients(c, 5.0, (1, 2))).log_determinant
        for c in motions
    ]
    assert found.information.log_determinant > max(others) + 20.0
    assert found.information == figures(found.trajectory)


def test_keeps_all_limits_of_the_cell(arm, found, verified):
    t = np.random.default_rng(0).uniform(0.0, 5.0, 1000)
    q, v, a = found.trajectory.motion(t)
    assert np.all((q >= arm.position_limits[:, 0]) & (q <= arm.position_limits[:, 1]))
    assert np.all(np.abs(v) <= arm.velocity_limit)
    assert np.all(np.abs(a) <= arm.acceleration_limit)
    again = verified(arm, found.trajectory, cell=CELL)
    assert again.problems == found.verification.problems == []
    assert again.clearance.guaranteed >= 0.018


@pytest.mark.slow
def test_condition_number(arm, found):
    by_condition = search(arm, replace(QUICK, criterion="condition"), cell=CELL)
    assert by_condition.information.condition_number < found.information.condition_number
    assert by_condition.information.log_determinant < found.information.log_determinant


@pytest.mark.slow
def test_delta(delta):
    found = search(delta, QUICK, {"acceleration": 30.0})
    assert found.information.base_parameters == 10
    assert found.information.log_determinant > 70.0
    assert found.verification.problems == []
    q = found.trajectory.motion(np.linspace(0.0, 5.0, 50))[0]
    for row in q:  # every posture is in the workspace
        robot = delta.delta
        np.testing.assert_allclose(
            robot.joint_coordinates(robot.tool_position(row)), row, atol=1e-9
        )


CRANE = """\
<robot name="crane">
  <link name="base"/>
  <link name="beam"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="hook"><inertial><origin xyz="0 0 0.1"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.005" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="swing" type="revolute"><parent link="base"/><child link="beam"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" velocity="2" effort="50"/></joint>
  <joint name="lift" type="prismatic"><parent link="beam"/><child link="hook"/>
    <origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="0.5" velocity="1" effort="100"/></joint>
</robot>
"""


@pytest.mark.slow
def test_model_file_with_a_slide_and_no_shapes(tmp_path):
    file = tmp_path / "crane.urdf"
    file.write_text(CRANE)
    crane = load_subject(file)
    cell = Cell([POST], tool_above=-0.2)
    found = search(crane, QUICK, {"acceleration": 10.0}, cell)
    assert found.warnings == ["crane: the model has no shapes; collisions are not checked"]
    assert found.verification.keeps_all
    q, _, _ = found.trajectory.motion(np.linspace(0.0, 5.0, 500))
    height = -0.4 * np.sin(q[:, 0]) + q[:, 1] * np.cos(q[:, 0])
    margin = found.verification.margins["height of the tool point"]
    assert height.min() == pytest.approx(-0.2 + margin, abs=1e-3)
    assert height.min() >= -0.2


def test_is_the_same_again(arm_problem):
    ends = [LocalSearch(arm_problem).run(seed, 5).coefficients for seed in (1, 1, 2)]
    np.testing.assert_array_equal(ends[0], ends[1])
    assert not np.allclose(ends[0], ends[2])


def test_progress(result_and_progress):
    _, progress_reports = result_and_progress
    fractions = [fraction for fraction, _ in progress_reports]
    assert fractions == sorted(fractions)
    assert "1 of 2 starts, best log det" in progress_reports[1][1]


@pytest.mark.slow(
    but=[
        "change0-criterion = 'E'; must be one of D, condition",
        "change1-starts = 0",
        "change3-period = 0.0 s",
        "change4-harmonics",
        "change6-nowhere.yaml",
        "change7-no joint 'elbow'",
        "change9-hardest to keep is the height of the flange",
    ]
)
@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"criterion": "E"}, "criterion = 'E'; must be one of D, condition"),
        ({"starts": 0}, "starts = 0"),
        ({"workers": 0}, "workers = 0; must be 1 or more"),
        ({"period": 0.0}, "period = 0.0 s"),
        ({"harmonics": ()}, "harmonics"),
        ({"harmonics": (1,)}, r"harmonics = \[1\]: too few to excite all 22 base .* link_3.Izz"),
        ({"cell": "nowhere.yaml"}, "nowhere.yaml"),
        ({"limits": {"velocity": {"elbow": 1.0}}}, "no joint 'elbow'"),
        ({"limits": {"effort": 1.0}}, "hardest to keep is the effort limit of joint_2"),
        (
            {"cell": Cell(tool_above=9.0, self_collision=False)},
            "hardest to keep is the height of the flange",
        ),
    ],
)
def test_refuses(arm, change, says):
    with pytest.raises(InputError, match=says):
        around = {"limits": None, "cell": CELL}
        options = {name: value for name, value in change.items() if name not in around}
        around |= {name: value for name, value in change.items() if name in around}
        search(arm, replace(QUICK, **options), **around)


def add(common, task):
    return common + task


def add_at_last(common, task):
    """End the process that is first to come here."""
    first = common / "first"
    if not first.exists():
        first.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return task


@pytest.mark.slow
def test_processes(tmp_path):
    """They are replaced where they are killed: with nothing to do, and in the middle of work."""
    with side_by_side(2, 3) as run:
        idle = psutil.Process().children(recursive=True)
        next(process for process in idle if "spawn_main" in " ".join(process.cmdline())).kill()
        assert sorted(run(add, 10, [1, 2, 3])) == [11, 12, 13]
        assert list(run(add, 20, [1])) == [21]
        assert sorted(run(add_at_last, tmp_path, [1, 2, 3])) == [1, 2, 3]
