"""Numbers in model files that no robot has."""

from functools import partial

import pytest

from pfsc_drake.robot.models.inspection import inspect_model
from pfsc_drake.robot.models.model_xml import read_model_xml


@pytest.fixture
def wrong(write, refused):
    """Change the first such text of a model and check that it is refused."""

    def check(text, name, old, new, *parts, fixed=frozenset()):
        changed = text.replace(old, new, 1)
        assert changed != text
        file = write(changed, name)
        line = text[: text.index(old)].count("\n") + 1
        refused(lambda: inspect_model([read_model_xml(file)], fixed), f"{file}:{line}", *parts)

    return check


MASSES = ["-2", "1e300", "nan", "inf", "", "abc", "1_0", "٣", "2,5", "0x10"]
INERTIAS = [("0.02", "0.2"), ("0.02", "-0.02"), ("0.01", "nan"), ("0.01", "")]


@pytest.mark.parametrize("mass", MASSES)
def test_masses(wrong, urdf_text, sdf_text, mass):
    parts = ("link", "mass = ", mass or "empty", "positive number")
    wrong(urdf_text, "a.urdf", '<mass value="2"', f'<mass value="{mass}"', "'upper'", *parts)
    wrong(sdf_text, "a.sdf", "<mass>2<", f"<mass>{mass}<", "'base'", *parts)


@pytest.mark.parametrize(("old", "new"), INERTIAS)
def test_moments_of_inertia(wrong, urdf_text, sdf_text, old, new):
    wrong(urdf_text, "a.urdf", f'"{old}"', f'"{new}"', "link 'upper'", "allowed")
    wrong(sdf_text, "a.sdf", f">{old}<", f">{new}<", "link 'base'", "allowed")


def test_products_of_inertia(wrong, urdf_text):
    """The diagonal alone is physical, with ixy it is not: 0.02 +- 0.03."""
    wrong(urdf_text, "a.urdf", 'ixy="0"', 'ixy="0.03"', "principal", "[-0.01, 0.01, 0.05]")


def test_parts_of_an_inertial_that_are_missing(wrong, urdf_text, sdf_text):
    wrong(urdf_text, "a.urdf", '<mass value="2"/>', "", "mass = empty")
    wrong(urdf_text, "a.urdf", 'izz="0.01"', "", "izz = missing")
    wrong(urdf_text, "a.urdf", '<mass value="2"/>', '<mass value="0"/>', "inertia = [0.02", "zeros")
    wrong(sdf_text, "a.sdf", "<mass>2</mass>", "", "mass = empty")
    wrong(sdf_text, "a.sdf", "<ixx>0.02</ixx>", "", "[0.01, 0.02, 1]")
    wrong(sdf_text, "a.sdf", "<inertial>", "<inertial auto='true'>", "auto")
    # without numbers SDF takes 1 kg m^2
    massless = "<inertial><mass>0</mass></inertial></link>\n<link"
    start = sdf_text.index("<inertial>")
    old = sdf_text[start : sdf_text.index("<link", start + 1) + 5]
    wrong(sdf_text, "a.sdf", old, massless, "ixx = missing")


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ('lower="-2"', 'lower="3"', "lower, upper = 3, 2"),
        ('lower="-2"', 'lower="2"', "lower, upper = 2, 2"),
        ('lower="-2"', 'lower="nan"', "lower = nan"),
        ('lower="-2"', 'lower="abc"', "lower = abc"),
        ('effort="30"', 'effort="-30"', "effort = -30"),
        ('xyz="0 0 0.3"', 'xyz="0 0 1e300"', "origin xyz = 1e300"),
        ('xyz="0 0 0.3"', 'xyz="0 0 x"', "origin xyz = x"),
        ('<axis xyz="0 0 1"', '<axis xyz="0 nan 1"', "axis xyz = nan"),
        ('velocity="1.5"', 'velocity="nan"', "velocity = nan"),
        ("</joint>", '<dynamics damping="-1"/></joint>', "damping = -1"),
        ("</joint>", '<dynamics friction="x"/></joint>', "friction = x"),
    ],
)
def test_urdf_joints(wrong, urdf_text, old, new, part):
    wrong(urdf_text, "a.urdf", old, new, "joint 'shoulder'", part, "allowed: ")


@pytest.mark.parametrize("key", ["rotor_inertia", "gear_ratio"])
@pytest.mark.parametrize("value", ["-1", "nan", "abc", ""])
def test_urdf_drives(wrong, urdf_text, key, value):
    drive = f'<transmission><actuator name="m"><drake:{key} value="{value}"/></actuator>'
    wrong(
        urdf_text,
        "a.urdf",
        "</robot>",
        f"{drive}</transmission></robot>",
        "actuator 'm'",
        f"drake:{key} = {value or 'empty'}",
    )


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ("<lower>-2<", "<lower>3<", "lower, upper = 3, 2"),
        ("<upper>2<", "<upper>nan<", "upper = nan"),
        ("<effort>30<", "<effort>abc<", "effort = abc"),
        ("<axis><xyz>0", "<axis><xyz>1e300", "axis xyz = 1e300"),
        ("<damping>0.5<", "<damping>-0.5<", "damping = -0.5"),
        ("<spring_stiffness>0<", "<spring_stiffness>-7<", "spring_stiffness = -7"),
        ("<spring_stiffness>0<", "<spring_stiffness>nan<", "spring_stiffness = nan"),
        ("<axis><xyz>", "<drake:gear_ratio>0</drake:gear_ratio><axis><xyz>", "gear_ratio = 0"),
        ("<axis><xyz>", "<drake:rotor_inertia>x</drake:rotor_inertia><axis><xyz>", "inertia = x"),
    ],
)
def test_sdf_joints(wrong, sdf_text, old, new, part):
    wrong(sdf_text, "a.sdf", old, new, "joint 'shoulder'", part, "allowed: ")


def test_sdf_marks_what_is_unlimited_by_negative_numbers(write, sdf_text):
    text = sdf_text.replace("<effort>30<", "<effort>-1<").replace("<lower>-2<", "<lower>-inf<")
    facts = inspect_model([read_model_xml(write(text, "a.sdf"))])
    assert facts.without_inertia == {} and facts.friction == []


def test_loops(write, refused, urdf_parts, sdf_text):
    urdf, _, joint = urdf_parts
    for parent, child in (("lower", "base_link"), ("base_link", "lower"), ("tcp", "tcp")):
        for kind in ("fixed", "revolute"):
            file = write(urdf(joint("back", parent, child, kind=kind)))
            model = read_model_xml(file)
            parts = f"{file}:9", "joint 'back'", f"'{child}'", "loop"
            refused(partial(inspect_model, [model]), *parts)
    back = (
        "<frame name='f' attached_to='g'/><frame name='g' attached_to='arm'/>"
        "<joint name='back' type='fixed'><parent>base</parent><child>f</child></joint></model>"
    )
    file = write(sdf_text.replace("</model>", back), "a.sdf")
    refused(lambda: inspect_model([read_model_xml(file)]), "joint 'back'", "loop")


def test_joints_that_are_fixed_anyway(write, urdf_text):
    text = urdf_text.replace('lower="-2"', 'lower="2"', 1)
    inspect_model([read_model_xml(write(text))], frozenset({"shoulder"}))


def test_facts(write, urdf_text):
    text = urdf_text.replace("</joint>", '<dynamics friction="2"/></joint>', 1)
    file = write(text)
    facts = inspect_model([read_model_xml(file)])
    assert facts.without_inertia == {"base_link": f"{file}:2", "tcp": f"{file}:5"}
    assert facts.effort_limits == {"shoulder": 30.0, "elbow": 30.0}
    assert facts.friction == ["shoulder"]


MJCF = """<mujoco><worldbody>
<body name="a"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<joint name="j" type="hinge" axis="0 0 1" range="-1 1" damping="1"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ('mass="1"', 'mass="-1"', "body 'a': mass = -1"),
        ('"1 1 1"', '"1 1 9"', "body 'a': principal"),
        ('<body name="a"', '<body name="a" pos="0 0 1e300"', "body 'a': pos = 1e300"),
        ('"-1 1"', '"1 -1"', "joint 'j': lower, upper = 1, -1"),
        ('damping="1"', 'damping="nan"', "joint 'j': damping = nan"),
        ("</mujoco>", "<equality><weld body1='a'/></equality></mujoco>", "equality"),
    ],
)
def test_mjcf(wrong, old, new, part):
    wrong(MJCF, "a.xml", old, new, part)
