"""A folder with the files that the documents name."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RotationMatrix
from pydrake.multibody.plant import MultibodyPlant

from experiments.scenario_file import SCENARIO_DIRECTORY
from pfsc_drake.robot.models.reading import ModelOptions, read_model

_LINK = (
    '<link name="{0}"><inertial><mass value="{1}"/><inertia ixx="{2}" iyy="{2}" izz="{2}" '
    'ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
_JOINT = (
    '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>'
    '<origin xyz="{4}" rpy="{5}"/><axis xyz="{6}"/>'
    '<limit lower="-6.3" upper="6.3" effort="{7}" velocity="3.2"/></joint>'
)
_UP, _TURNED = "0 0 0", "0 1.5707963268 0"
# of an arm with three parallel axes and a wrist, a finger and a tool on it
_JOINTS = [
    ("pan", "revolute", "base", "shoulder", "0 0 0.0892", _UP, "0 0 1", 330),
    ("lift", "revolute", "shoulder", "upper", "0 0.1359 0", _TURNED, "0 1 0", 330),
    ("elbow", "revolute", "upper", "fore", "0 -0.1197 0.425", _UP, "0 1 0", 150),
    ("wrist_1", "revolute", "fore", "first", "0 0 0.3923", _TURNED, "0 1 0", 56),
    ("wrist_2", "revolute", "first", "second", "0 0.093 0", _UP, "0 0 1", 56),
    ("wrist_3", "revolute", "second", "third", "0 0 0.0947", _UP, "0 1 0", 56),
    ("finger", "prismatic", "third", "pad", "0 0.08 0", _UP, "1 0 0", 20),
    ("flange", "fixed", "third", "tcp", "0 0.0823 0", "0 0 1.5707963268", "0 0 1", 1),
]
_MASSES = {"base": 4.0, "shoulder": 3.7, "upper": 8.4, "fore": 2.3} | dict.fromkeys(
    ["first", "second"], 1.2
)
NO_FINGER = "no_finger"  # folder with an arm without a gripper
_POSTURE = np.deg2rad([-37, -80, 89, -94, -93, -126])  # that of the README


@pytest.fixture(scope="session")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder as a reader has it, beside copies of what shipped scenarios name."""
    folder = tmp_path_factory.mktemp("desk")
    for name in ("paths", "surfaces"):
        shutil.copytree(SCENARIO_DIRECTORY / name, folder / name)
    _write_arm(folder)
    u, v = np.meshgrid(np.linspace(-1.0, 1.0, 15), np.linspace(-1.0, 1.0, 15), indexing="ij")
    sheet = np.stack([0.2 * u, 0.15 * v, 0.03 * np.sin(2.0 * u) * np.cos(v)], axis=-1)
    _write(folder / "scan.csv", "x,y,z", 1e3 * sheet)
    _write(folder / "surfaces/panel.csv", "x,y,z", sheet + np.array([0.9, 0.0, 0.72]))
    turns, heights = np.meshgrid(
        np.arange(20) * np.pi / 10.0, np.linspace(0.0, 0.4, 25), indexing="ij"
    )
    radii = 0.3 + 0.05 * heights
    tube = np.stack([radii * np.cos(turns), radii * np.sin(turns), heights], axis=-1)
    _write(folder / "grid.csv", "x,y,z", tube)
    s = np.linspace(0.0, 1.0, 12)
    _write(folder / "profile.csv", "radius,height", np.stack([0.3 + 0.1 * s**2, s], axis=-1))
    _write(folder / "section.csv", "x,y,z", np.stack([s, 0.0 * s, 0.2 * s**2], axis=-1))
    return folder


def _write_arm(folder: Path) -> None:
    """Write a robot, and what a hand taught it: 0.6 m from the README's posture on."""
    (folder / "my_arm.urdf").write_text(_urdf(_JOINTS), encoding="utf-8")
    plant = MultibodyPlant(time_step=0.0)
    read_model(plant, folder / "my_arm.urdf", ModelOptions(fixed_joints={"finger": 0.02}))
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, _POSTURE)
    X_WE = plant.GetFrameByName("tcp").CalcPoseInWorld(context)
    s = np.linspace(0.0, 1.0, 40)
    way = np.stack([-0.1 * s, 0.55 * s, 0.05 * np.sin(np.pi * s)], axis=-1)
    turns = [RotationMatrix.MakeZRotation(0.4 * x) @ X_WE.rotation() for x in s]
    quaternions = np.array([turn.ToQuaternion().wxyz() for turn in turns])
    table = np.hstack([X_WE.translation() + way, quaternions])
    _write(folder / "teach_in.csv", "x,y,z,qw,qx,qy,qz", table)
    # the README's arm has no finger
    (folder / NO_FINGER).mkdir()
    joints = [joint for joint in _JOINTS if joint[0] != "finger"]
    (folder / NO_FINGER / "my_arm.urdf").write_text(_urdf(joints), encoding="utf-8")
    shutil.copy(folder / "teach_in.csv", folder / NO_FINGER)


def _urdf(joints: list[tuple]) -> str:
    """Return a model file."""
    links = dict.fromkeys(link for joint in joints for link in joint[2:4])
    text = "".join(
        _LINK.format(link, _MASSES.get(link, 0.2), 0.01 * _MASSES.get(link, 0.2)) for link in links
    )
    text += "".join(_JOINT.format(*joint) for joint in joints)
    return f'<robot name="mine">{text}</robot>'


def _write(file: Path, columns: str, values: np.ndarray) -> None:
    rows = values.reshape(-1, values.shape[-1])
    np.savetxt(file, rows, delimiter=",", header=columns, comments="", fmt="%.9f")
