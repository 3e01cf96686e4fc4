"""Stations of robots of which kinematics alone are known."""

import pytest

from diagrams.scenario import HandParameters, Scenario
from diagrams.scenario.massless import check_massless
from experiments.cli import main
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.reading import read_yaml
from pfsc_drake.yaml.typed import load_typed

_SCENARIO = """
robot: {model: arm.urdf, tool_frame: tool}
path: {shape: !Line {start: [0.5, -0.1, 0.3], end: [0.5, 0.1, 0.3]}, orientation: {task: none}}
controller:
  law: velocity_servo
  gains: {velocity_servo: {eta: &p {poles: auto, bandwidth: 20}, xi: *p}}
reference: {points: [0, 0.15], velocity: 0.1, acceleration: 0.5}
start: {posture_deg: [0, 30, 60]}
"""
_JOINT = (
    '<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
    '<origin xyz="{xyz}"/><axis xyz="{axis}"/>'
    '<limit lower="-3" upper="3" effort="{effort}" velocity="2"/></joint><link name="{child}"/>'
)


@pytest.fixture(name="scenario")
def fixture_scenario(tmp_path):
    """Write a scenario with an arm of three joints without mass, and return its file."""
    joints = (
        ("j1", "base", "l1", "0 0 0.3", "0 0 1", "0"),
        ("j2", "l1", "l2", "0 0 0.1", "0 1 0", "40"),
        ("j3", "l2", "l3", "0.4 0 0", "0 1 0", "0"),
    )
    keys = ("name", "parent", "child", "xyz", "axis", "effort")
    text = "".join(_JOINT.format(**dict(zip(keys, joint, strict=True))) for joint in joints)
    text += '<joint name="f" type="fixed"><parent link="l3"/><child link="tool"/>'
    text += '<origin xyz="0.35 0 0"/></joint><link name="tool"/>'
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm"><link name="base"/>{text}</robot>')
    file = tmp_path / "servos.yaml"
    file.write_text(_SCENARIO)
    return file


def _run(file, *changes):
    out = file.parent / "out"
    given = [part for change in changes for part in ("--set", change)]
    short = ("--duration", "0.1", "--no-figures", "--no-recording")
    return main(["run", str(file), "--out", str(out), *short, *given]), out


@pytest.mark.slow
def test_it_follows_a_path_and_tells_no_torques(scenario, capsys):
    status, out = _run(scenario)
    printed = capsys.readouterr()
    assert status == 0, printed.err
    assert "without mass" in printed.out + printed.err
    metrics = (out / "metrics.json").read_text()
    assert "max_path_deviation" in metrics
    assert "torque" not in metrics


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ("forces=[{begin: 0.1, end: 0.3, force: [5, 0, 0]}]", "forces"),
        ("friction.f_c=[1.0]", "friction"),
        ("drive_friction=true", "drive_friction"),
        ("hold_back.force=-3", "hold_back"),
        ("controller.external_torque.source=known", "controller.external_torque.source"),
        ("model_error.mass=[0.9]", "model_error"),
        ("faults.brakes.torque=[50]", "faults.brakes.torque"),
        ("reference.speed=fastest", "reference.speed"),
        ("controller.law=rigid", "link 'l1'"),
    ],
)
def test_what_needs_masses_is_refused_by_name(scenario, capsys, change, key):
    status, _ = _run(scenario, change)
    lines = [line for line in capsys.readouterr().err.splitlines() if "error:" in line]
    assert status == 2 and len(lines) == 1
    assert f"{key} = " in lines[0] or f"{key}: " in lines[0]


def test_kinematics_alone_are_enough_otherwise(scenario):
    """A block that needs masses is refused of the same scenario, read likewise."""
    settings = load_typed(Scenario, read_yaml(scenario), str(scenario))
    check_massless(settings)
    settings.hand = HandParameters()
    with pytest.raises(InputError, match="hand = given; allowed: left out"):
        check_massless(settings)


def test_margins_need_masses(scenario, capsys):
    assert main(["margins", str(scenario), "--out", str(scenario.parent / "m")]) == 2
    assert "robot.model = arm.urdf; allowed: a model with masses" in capsys.readouterr().err


def test_a_nominal_model_has_masses_if_the_robot_has(scenario, capsys):
    text = (scenario.parent / "arm.urdf").read_text()
    mass = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" '
    mass += 'ixy="0" ixz="0" iyz="0"/></inertial>'
    for link in ("l1", "l2", "l3"):
        text = text.replace(f'<link name="{link}"/>', f'<link name="{link}">{mass}</link>')
    (scenario.parent / "heavy.urdf").write_text(text)
    status, _ = _run(scenario, "controller.model=heavy.urdf")
    assert status == 2
    assert "controller.model = heavy.urdf: has masses" in capsys.readouterr().err
