"""Runs of robots whose makers' pictures are in disorder: the report is written all the same."""

import pytest

SCENARIO = """
name: mine
robot: {{model: {model}, tool_frame: tool}}
path:
  shape: !Line {{start: [0.7, -0.1, 0.4], end: [0.7, 0.2, 0.4]}}
controller:
  law: rigid
  gains:
    rigid:
      eta: {{poles: [-20, -20]}}
      xi: {{poles: [-30, -30]}}
reference: {{points: [0.0, 0.1], velocity: 0.3, acceleration: 1.0}}
start: {{posture_deg: [0, -60, 90]}}
"""
AXES = ("0 0 1", "0 1 0", "0 1 0")


def visual(content):
    return f"<visual><geometry>{content}</geometry></visual>"


def write(folder, looks):
    """An arm of three links: one up, two that reach out."""
    links, joints = ['<link name="world"/>'], []
    ends = ("0 0 0.3", "0.5 0 0", "0.5 0 0")
    centres = ("0 0 0.15", "0.25 0 0", "0.25 0 0")
    parents = ("world", "link_1", "link_2")
    at = ("0 0 0", ends[0], ends[1])
    for i in range(3):
        links.append(
            f'<link name="link_{i + 1}"><inertial><origin xyz="{centres[i]}"/><mass value="3"/>'
            '<inertia ixx="0.05" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial>'
            f"{looks[i]}</link>"
        )
        joints.append(
            f'<joint name="joint_{i + 1}" type="revolute"><parent link="{parents[i]}"/>'
            f'<child link="link_{i + 1}"/><origin xyz="{at[i]}"/><axis xyz="{AXES[i]}"/>'
            '<limit lower="-3" upper="3" effort="200" velocity="9"/></joint>'
            f'<transmission name="t_{i}"><type>transmission_interface/SimpleTransmission</type>'
            f'<joint name="joint_{i + 1}"><hardwareInterface>EffortJointInterface'
            f'</hardwareInterface></joint><actuator name="motor_{i + 1}"/></transmission>'
        )
    model = folder / "arm.urdf"
    model.write_text(
        f'<robot name="arm">{"".join(links + joints)}'
        f'<frame name="tool" link="link_3" xyz="{ends[2]}" rpy="0 0 0"/></robot>'
    )
    scenario = folder / "mine.yaml"
    scenario.write_text(SCENARIO.format(model=model))
    return scenario


@pytest.mark.slow
@pytest.mark.parametrize(
    ("look", "said"),
    [
        ('<mesh filename="package://gone/part.stl"/>', "write robot.packages: {gone: FOLDER}"),
        ('<mesh filename="part.dae"/>', "part.dae: holds no mesh that could be drawn"),
        (None, None),
    ],
)
def test_report_and_recording_are_written(run_scenario, tmp_path, look, said):
    (tmp_path / "part.dae").write_text("<COLLADA/>")
    box = visual('<box size="0.1 0.1 0.1"/>')
    scenario = write(tmp_path, (box, visual(look), box) if look else ("", "", ""))
    out = tmp_path / "out"
    run = run_scenario(out, scenario, "--duration", "0.1", complete=True)
    assert run.status == 0
    report = (out / "report.html").read_text(encoding="utf-8")
    assert "recording.html" in report
    assert (out / "recording.html").stat().st_size > 1e6
    assert ("not drawn of the robot: link_2" in run.stdout) == (look is not None)
    assert (said is None) or (said.replace("'", "&#x27;") in report)
    # a rigid robot gets the cheapest scheme
    assert "runge_kutta2 in steps of 1 ms: the cheapest" in run.attributes["integration"]
