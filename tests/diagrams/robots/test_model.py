"""The robot in a diagram."""

import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from diagrams.robots.model import read_robot, tool_frame
from diagrams.scenario import RobotParameters
from diagrams.scenario.robot import ElasticParameters, PoseParameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant

SHIPPED = "comau_racer_1_4_elastic_3r"


def add(model, folder=Path()):
    plant, _ = read_robot(RobotParameters(model), folder)
    return plant


@pytest.mark.parametrize(
    ("model", "positions", "drives"),
    [
        ("comau_racer_1_4", 6, 6),
        ("comau_racer_1_4_elastic", 12, 6),
        ("comau_racer_1_4_3r", 3, 3),
        ("comau_racer_1_4_elastic_3r", 6, 3),
    ],
)
def test_shipped_robots_are_continuous_and_without_geometry(model, positions, drives):
    plant, warnings = read_robot(RobotParameters(model), Path())
    assert warnings == []
    assert plant.num_positions() == plant.num_velocities() == positions
    assert plant.num_actuators() == drives
    assert plant.is_finalized()
    assert plant.time_step() == 0.0
    assert not plant.geometry_source_is_registered()


def test_a_file_is_relative_to_the_folder(tmp_path, monkeypatch):
    (tmp_path / "mine").mkdir()
    shutil.copy(resolve_model(SHIPPED), tmp_path / "mine" / "arm.sdf")
    assert add("mine/arm.sdf", tmp_path).num_positions() == 6
    monkeypatch.chdir(tmp_path / "mine")
    with pytest.raises(InputError, match=r"arm\.sdf': no such file"):
        add("mine/arm.sdf", tmp_path / "mine")


def test_a_model_that_is_read_again_is_a_copy_of_its_own(tmp_path):
    """And it is read anew where its file, or one that it includes, has changed."""
    text = resolve_model(SHIPPED).read_text(encoding="utf-8")
    (tmp_path / "arm.sdf").write_text(text, encoding="utf-8")
    (tmp_path / "package.xml").write_text("<package><name>own</name></package>", encoding="utf-8")
    (tmp_path / "all.sdf").write_text(
        "<sdf version='1.9'><model name='all'><include merge='true'>"
        "<uri>package://own/arm.sdf</uri></include>"
        "</model></sdf>",
        encoding="utf-8",
    )
    first, second = add("all.sdf", tmp_path), add("all.sdf", tmp_path)
    assert first is not second
    for plant in (first, second):
        assert chain_from_plant(plant, tool_frame(plant, RobotParameters("all.sdf")))[0].K_s.any()
    first.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -1.0])
    again = add("all.sdf", tmp_path)
    for plant in (second, again):
        np.testing.assert_array_equal(plant.gravity_field().gravity_vector(), [0.0, 0.0, -9.81])
    weight = again.CalcTotalMass(again.CreateDefaultContext())
    heavier = re.sub(r"<mass>([^<]+)</mass>", lambda m: f"<mass>{2 * float(m[1])}</mass>", text)
    (tmp_path / "arm.sdf").write_text(heavier, encoding="utf-8")
    changed = add("all.sdf", tmp_path)
    assert changed.CalcTotalMass(changed.CreateDefaultContext()) == pytest.approx(2.0 * weight)


def test_file_names_that_do_not_depend_on_the_folder(tmp_path):
    address = "package://pfsc_models/comau_racer_1_4/comau_racer_1_4_elastic_3r.sdf"
    assert add(address, tmp_path).num_positions() == 6
    absolute = str(resolve_model(SHIPPED).resolve())
    assert add(absolute, tmp_path).num_positions() == 6


def test_keys_of_the_scenario(tmp_path):
    """What the keys do is tested with the library; here, that they arrive, in their units."""
    (tmp_path / "meshes").mkdir()
    parameters = RobotParameters(
        "comau_racer_1_4_3r",
        base_pose=PoseParameters([0.1, 0.2, 2.0], [90.0, 0.0, 180.0]),
        gravity=[0.0, 0.0, -1.62],
        fixed_joints={"joint_3": 0.5},
        packages={"mine": "meshes"},
        elastic=ElasticParameters([2e4, np.inf], rotor_inertia=[1e-3], gear_ratio=[100.0]),
    )
    plant, warnings = read_robot(parameters, tmp_path)
    assert warnings == []
    chain, _ = chain_from_plant(plant, plant.GetFrameByName("tool_point"))
    assert chain.names == ["joint_1", "joint_2"]
    np.testing.assert_array_equal(chain.gravity, [0.0, 0.0, -1.62])
    np.testing.assert_array_equal(chain.K_s, [2e4, np.inf])
    np.testing.assert_allclose(chain.D_M, 10.0)
    X_WB = plant.GetFrameByName("base").CalcPoseInWorld(plant.CreateDefaultContext())
    np.testing.assert_allclose(X_WB.translation(), [0.1, 0.2, 2.0], atol=1e-12)
    # upside down, then a quarter turn about the vertical: the base's x looks along y
    expected = [[0, 1, 0], [1, 0, 0], [0, 0, -1]]
    np.testing.assert_allclose(X_WB.rotation().matrix(), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"base": "nope"}, "robot.base: 'nope'"),
        ({"fixed_joints": {"nope": 0.0}}, "robot.fixed_joints: 'nope'"),
        ({"packages": {"mine": "nope"}}, "robot.packages: mine"),
        ({"elastic": ElasticParameters([1.0, 2.0])}, "robot.elastic.stiffness: 2 values"),
        ({"joint_damping": [1.0]}, "robot.joint_damping: 1 values"),
    ],
)
def test_keys_that_do_not_suit_the_model(tmp_path, changes, message):
    with pytest.raises(InputError) as caught:
        read_robot(RobotParameters("comau_racer_1_4_3r", **changes), tmp_path)
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"gravity": [0.0, 9.81]}, "gravity"),
        ({"gravity": [0.0, 0.0, math.inf]}, "gravity"),
        ({"gravity": [0.0, 0.0, 1e300]}, "gravity"),
        ({"fixed_joints": {"j": math.inf}}, "fixed_joints.j"),
    ],
)
def test_values_out_of_range(changes, key):
    with pytest.raises(InputError, match=rf"^{key} = .*allowed"):
        RobotParameters(**changes)


@pytest.mark.parametrize("key", ["position", "zyx_deg"])
def test_poses_out_of_range(key):
    with pytest.raises(InputError, match=rf"^{key} = .*3 finite numbers"):
        PoseParameters(**{key: [0.0, 1.0]})


@pytest.mark.parametrize("content", ["no robot", "<sdf version='1.9'><model name='x'>", ""])
@pytest.mark.parametrize("suffix", ["sdf", "urdf"])
def test_unreadable_model(tmp_path, suffix, content):
    file = tmp_path / f"arm.{suffix}"
    file.write_text(content, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        add(file.name, tmp_path)
    assert str(caught.value).startswith(f"robot.model: {file}: cannot be read: ")
    assert "\n" not in str(caught.value)


def test_tool_frame():
    plant = add(SHIPPED)
    assert tool_frame(plant, RobotParameters(SHIPPED)).name() == "tool_point"
    with pytest.raises(InputError) as caught:
        tool_frame(plant, RobotParameters(SHIPPED, "gripper"))
    for part in ("robot.tool_frame", SHIPPED, "'gripper'"):
        assert part in str(caught.value)
