"""A robot of the user's own, as its file comes: floating, no transmissions, frames without mass."""

import pytest

LINK = (
    '<link name="{}"><inertial><origin xyz="0.2 0 0"/><mass value="4"/>'
    '<inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="j{0}" type="revolute"><parent link="{1}"/><child link="{2}"/>'
    '<origin xyz="{3}"/><axis xyz="{4}"/>'
    '<limit lower="-3" upper="3" effort="300" velocity="3"/>{5}</joint>'
)
ROBOT = f"""<robot name="mine">
<link name="base_link"/>
{LINK.format("l1")}{LINK.format("l2")}{LINK.format("l3")}
{JOINT.format(1, "base_link", "l1", "0 0 0.4", "0 0 1", "")}
{JOINT.format(2, "l1", "l2", "0 0 0", "0 1 0", "")}
{JOINT.format(3, "l2", "l3", "0.4 0 0", "0 1 0", "<dynamics friction='1'/>")}
<link name="tcp"/><joint name="t" type="fixed"><parent link="l3"/><child link="tcp"/>
<origin xyz="0.4 0 0"/></joint></robot>"""

SCENARIO = """
name: mine
robot: {model: arm.urdf, tool_frame: tcp}
path: {shape: !Line {start: [0.5, -0.1, 0.4], end: [0.5, 0.3, 0.4]}}
controller:
  law: rigid
  gains:
    rigid: {eta: {poles: [-30, -30]}, xi: {poles: [-30, -30]}}
    elastic: {eta: {poles: [-40, -40, -40, -40]}, xi: {poles: [-40, -40, -40, -40]}}
reference: {points: [0.1, 0.3], velocity: 0.3, acceleration: 1.0, dwell: 0.3}
start: {offset: [0.002, 0.0], posture_deg: [0, -60, 100]}
"""

ELASTIC = (
    "controller.law=elastic",
    "robot.elastic={stiffness: 9e3, rotor_inertia: 1e-4, gear_ratio: 100}",
)


@pytest.fixture
def scenario(tmp_path):
    """The scenario beside its robot."""
    (tmp_path / "arm.urdf").write_text(ROBOT, encoding="utf-8")
    file = tmp_path / "mine.yaml"
    file.write_text(SCENARIO, encoding="utf-8")
    return file


@pytest.mark.slow(but="changes1")
@pytest.mark.parametrize("changes", [(), ELASTIC])
def test_run(run_scenario, scenario, tmp_path, capfd, changes):
    overrides = [argument for change in changes for argument in ("--set", change)]
    run = run_scenario(tmp_path / "out", scenario, "--duration", "0.9", *overrides)
    assert run.status == 0
    assert run.metrics["max_path_deviation_while_moving"]["value"] < 2e-5
    (warning,) = [line for line in run.stdout.splitlines() if "warning" in line]
    assert "dry friction" in warning and "j3" in warning
    assert capfd.readouterr().err == ""
    # the resolved scenario runs again, from wherever
    again = run_scenario(tmp_path / "again", tmp_path / "out/scenario.yaml", "--duration", "0.01")
    assert again.status == 0
