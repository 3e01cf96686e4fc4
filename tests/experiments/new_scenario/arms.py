"""Robot models and points for first scenarios."""

import numpy as np

AXES = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0"]
ORIGINS = ["0 0 0.4", "0.1 0 0", "0 0 0.5", "0.3 0 0.1", "0.2 0 0", "0.1 0 0"]
INERTIAL = (
    '<inertial><origin xyz="0.05 0 0.02"/><mass value="{}"/><inertia ixx="0.02" iyy="0.03" '
    'izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial>'
)
GRIPPER = """
<link name="hand">{mass}</link><joint name="mount" type="fixed"><parent link="l6"/>
<child link="hand"/><origin xyz="0.05 0 0"/></joint>
<joint name="finger_1" type="prismatic"><parent link="hand"/><child link="f1"/><axis xyz="0 1 0"/>
<limit lower="0.01" upper="0.04" effort="20" velocity="1"/></joint><link name="f1">{mass}</link>
<joint name="finger_2" type="prismatic"><parent link="hand"/><child link="f2"/><axis xyz="0 -1 0"/>
<limit lower="0" upper="0.04" effort="20" velocity="1"/>
<mimic joint="finger_1" multiplier="0.5"/></joint><link name="f2">{mass}</link>
<joint name="point" type="fixed"><parent link="hand"/><child link="my_tcp"/><origin xyz="0.1 0 0"/>
</joint><link name="my_tcp"/>"""


LINK = INERTIAL.format(1.3)


def arm(joints=6, inertial=LINK, more=""):
    """Return a URDF: an arm, and what else there is on its last link."""
    parts = ['<robot name="mine"><link name="base"/>']
    for i in range(joints):
        parent = f"l{i}" if i else "base"
        parts.append(
            f'<joint name="j{i + 1}" type="revolute"><parent link="{parent}"/>'
            f'<child link="l{i + 1}"/><origin xyz="{ORIGINS[i]}"/><axis xyz="{AXES[i]}"/>'
            '<limit lower="-2.8" upper="2.8" effort="230" velocity="3"/></joint>'
            f'<link name="l{i + 1}">{inertial}</link>'
        )
    return "".join(parts) + more + "</robot>"


TOOL = (
    '<joint name="t" type="fixed"><parent link="l6"/><child link="tool0"/></joint>'
    '<link name="tool0"/>'
)


def arc(count=9, scale=1.0, offset=(0.7, 0.0, 0.6)):
    """Return points on an arc of 0.1 m radius."""
    angle = np.linspace(0.2, 1.7, count)
    ring = np.stack([0.1 * np.cos(angle), 0.1 * np.sin(angle), 0.02 * angle], axis=1)
    return scale * (ring + offset)
