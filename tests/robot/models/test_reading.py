"""From model files to plants, and what is said about them."""

import logging

import numpy as np
import pytest
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.models.reading import read_model
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant


def chain_of(plant, tool="tcp"):
    return chain_from_plant(plant, plant.GetFrameByName(tool))


def test_an_ordinary_urdf_needs_no_edit(write, read, urdf_text):
    """It floats, has frames without mass and no transmissions."""
    plant, warnings = read(write(urdf_text))
    assert warnings == []
    chain, coordinates = chain_of(plant)
    assert chain.names == ["shoulder", "elbow"]
    assert chain.gather("mass").tolist() == [2.0, 2.0]
    assert chain.gather("effort_limit").tolist() == [30.0, 30.0]
    assert chain.gather("velocity_limit").tolist() == [1.5, 1.5]
    assert sorted(coordinates.actuators) == [0, 1]
    assert plant.num_positions() == 2
    q = np.zeros(2)
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    tip = plant.GetFrameByName("tcp").CalcPoseInWorld(context).translation()
    np.testing.assert_allclose(tip, [0, 0, 0.9], atol=1e-12)


def test_an_actuator_of_the_model_stays(write, read, urdf_parts):
    urdf, _, _ = urdf_parts
    drive = (
        '<transmission type="SimpleTransmission"><joint name="elbow"/><actuator name="m">'
        '<drake:rotor_inertia value="1e-3"/><drake:gear_ratio value="10"/>'
        "</actuator></transmission>"
    )
    plant, _ = read(write(urdf(drive)))
    chain, _ = chain_of(plant)
    np.testing.assert_allclose(chain.D_M, [0.0, 0.1], rtol=1e-12)
    assert chain.gather("effort_limit").tolist() == [30.0, 30.0]


def test_joints_that_cannot_be_driven(write, read, refused, urdf_text, sdf_text):
    file = write(urdf_text.replace('effort="30"', 'effort="0"', 1))
    refused(lambda: read(file), file, "'shoulder'", "effort = 0")
    file = write(sdf_text.replace("<effort>30<", "<effort>0<"), "arm.sdf")
    refused(lambda: read(file), file, "'shoulder'", "actuator", "effort = 0")


def test_a_velocity_limit_of_zero_is_none(write, read, urdf_text):
    plant, warnings = read(write(urdf_text.replace('velocity="1.5"', 'velocity="0"', 1)))
    assert chain_of(plant)[0].gather("velocity_limit").tolist() == [np.inf, 1.5]
    (warning,) = warnings
    assert "(shoulder)" in warning and "velocity limits of 0" in warning


def test_dry_friction_is_reported(write, read, urdf_text):
    friction = '<dynamics damping="0.1" friction="2"/></joint>'
    file = write(urdf_text.replace("</joint>", friction, 1))
    (warning,) = read(file)[1]
    assert str(file) in warning and "friction" in warning and "shoulder" in warning


def test_drakes_warnings_are_returned_and_not_printed(write, read, urdf_parts, capfd, caplog):
    urdf, _, _ = urdf_parts
    reduction = (
        "<transmission name='t'><type>SimpleTransmission</type><joint name='elbow'/>"
        "<actuator name='m'><mechanicalReduction>3</mechanicalReduction></actuator></transmission>"
    )
    file = write(urdf(reduction))
    logger = logging.getLogger("drake")
    before = logger.level, logger.propagate, logger.handlers[:]
    (warning,) = read(file)[1]
    assert str(file) in warning and "mechanicalReduction" in warning and "\n" not in warning
    assert (logger.level, logger.propagate, logger.handlers[:]) == before
    assert capfd.readouterr() == ("", "") and not caplog.records


def test_links_that_move_without_mass(write, read, refused, urdf_parts, sdf_text):
    urdf, link, joint = urdf_parts
    massless = urdf().replace(link("lower"), link("lower", ""))
    file = write(massless)
    refused(lambda: read(file), f"{file}:4", "link 'lower'", "no <inertial>", "positive mass")
    # one that is fixed to a link with mass is a frame; alone on a joint it is none
    file = write(urdf(link("x", ""), joint("j", "tcp", "x")))
    refused(lambda: read(file), "link 'x'", "no <inertial>")
    read(write(urdf(link("x", ""), joint("j", "tcp", "x", "", "fixed"))))
    zero = '<inertial><mass value="0"/></inertial>'
    file = write(urdf(link("x", zero), joint("j", "tcp", "x")))
    refused(lambda: read(file), "link 'x'", "no mass")
    # between two joints a body may be without mass if the model says so
    between = urdf(link("x", zero), joint("j", "tcp", "x"), link("y"), joint("k", "x", "y"))
    file = write(between)
    refused(lambda: read(file), "mass matrix")  # j and k turn about the same axis
    across = joint("k", "x", "y", axis="1 0 0")
    plant, _ = read(write(urdf(link("x", zero), joint("j", "tcp", "x"), link("y"), across)))
    assert plant.num_positions() == 4


def test_sdf_links_without_inertial_get_a_default_mass(write, read, refused, sdf_text):
    tcp = (
        "<link name='tcp'/>\n<joint name='t' type='fixed'><parent>arm</parent><child>tcp</child>"
        "</joint></model>"
    )
    file = write(sdf_text.replace("</model>", tcp), "arm.sdf")
    refused(lambda: read(file), f"{file}:6", "link 'tcp'", "1 kg")
    on_base = tcp.replace("<parent>arm", "<parent>base")
    read(write(sdf_text.replace("</model>", on_base), "arm.sdf"))


def test_point_mass_on_its_axis(write, read, refused, urdf_text):
    before, after = urdf_text.split('<link name="lower">')
    after = after.replace('xyz="0 0 0.1"', 'xyz="0 0 0"')
    for moment in ("0.02", "0.01"):
        after = after.replace(f'="{moment}"', '="0"')
    file = write(before + '<link name="lower">' + after)
    refused(lambda: read(file), file, "joint 'elbow'", "inertia")


def test_loose_bodies(write, read, refused, urdf_parts, sdf_text):
    urdf, link, _ = urdf_parts
    file = write(urdf(link("brick"), link("ball")))
    refused(lambda: read(file), "base", "'brick', 'ball'", "one robot")
    loose = "<link name='brick'><inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>1</iyy>"
    loose += "<izz>1</izz></inertia></inertial></link></model>"
    file = write(sdf_text.replace("</model>", loose), "arm.sdf")
    refused(lambda: read(file), "'brick'", "hang on nothing")


def test_joints_that_are_no_axes(write, read, refused, urdf_parts):
    urdf, link, joint = urdf_parts
    plant, _ = read(write(urdf(link("x"), joint("j", "tcp", "x", "", "planar"))))
    refused(lambda: chain_of(plant, "x"), "'j'", "only revolute")
    file = write(urdf(link("x"), joint("j", "tcp", "x", "", "floating")))
    refused(lambda: read(file), "'x'", "hang on nothing")


def test_mimic_joints(write, read, refused, urdf_parts):
    urdf, link, joint = urdf_parts
    limit = '<limit lower="0" upper="0.04" effort="20" velocity="1"/>'
    fingers = [
        link("left"),
        link("right"),
        joint("finger_1", "tcp", "left", limit, "prismatic"),
        joint("finger_2", "tcp", "right", limit + '<mimic joint="finger_1"/>', "prismatic"),
    ]
    file = write(urdf(*fingers))
    refused(lambda: read(file), file, "'finger_2'", "mimic", "fixed_joints: {finger_1: VALUE}")
    for fixed in ({"finger_1": 0.02, "finger_2": 0.02}, {"finger_1": 0.02}):
        plant, warnings = read(file, fixed_joints=fixed)
        assert warnings == []
        assert chain_of(plant)[0].gather("mass").tolist() == [2.0, 6.0]
    # a leader that the model itself fixes, which Drake does not let others follow
    fingers[2] = joint("finger_1", "tcp", "left", "", "fixed")
    plant, warnings = read(write(urdf(*fingers)))
    assert warnings == []
    assert chain_of(plant)[0].gather("mass").tolist() == [2.0, 6.0]


def place_of(plant, body):
    """Return where a body stands in the flange, by Drake's kinematics."""
    context = plant.CreateDefaultContext()
    frames = [plant.GetFrameByName(name) for name in (body, "tcp")]
    return frames[0].CalcPose(context, frames[1]).translation()


def test_what_follows_a_fixed_joint_stands_where_that_puts_it(write, read, refused, urdf_parts):
    """Slides along z from 0.3 m, one following the other, the last following that."""
    urdf, link, joint = urdf_parts
    limit = '<limit lower="-1" upper="1" effort="20" velocity="1"/>'
    follows = '<mimic joint="{}" multiplier="{}" offset="{}"/>'

    def fingers(third='<mimic joint="b" multiplier="0.5"/>'):
        inside = ["", follows.format("a", -2, 0.05), third]
        joints = [
            joint(name, "tcp", f"link_{name}", limit + message, "prismatic")
            for name, message in zip("abc", inside, strict=True)
        ]
        return urdf(*[link(f"link_{name}") for name in "abc"], *joints)

    plant, warnings = read(write(fingers()), fixed_joints={"a": 0.1})
    assert warnings == []
    for name, slid in {"a": 0.1, "b": -0.15, "c": -0.075}.items():
        np.testing.assert_allclose(place_of(plant, f"link_{name}"), [0, 0, 0.3 + slid], atol=1e-15)
    plant, _ = read(write(fingers()), fixed_joints={"a": 0.1, "b": 0.2})
    np.testing.assert_allclose(place_of(plant, "link_c"), [0, 0, 0.4], atol=1e-15)
    file = write(fingers())
    refused(lambda: read(file, fixed_joints={"a": 0.9}), "fixed_joints: b = -1.75 m", "-1 to 1 m")
    file = write(fingers('<mimic joint="c"/>'))
    refused(lambda: read(file, fixed_joints={"a": 0.1}), file, "'c'", "mimic = c")
    file = write(fingers('<mimic joint="b" multiplier="x"/>'))
    refused(lambda: read(file, fixed_joints={"a": 0.1}), "'c'", "mimic multiplier = x")


def test_what_follows_in_the_other_formats(write, read, refused, sdf_text):
    """SDF with a reference, and MJCF, where an equality ties two joints."""
    finger = (
        "<link name='f{0}'><inertial><mass>1</mass></inertial></link><joint name='j{0}' "
        "type='prismatic'><parent>arm</parent><child>f{0}</child><axis><xyz>0 0 1</xyz>{1}</axis>"
        "</joint>"
    )
    mimic = "<mimic joint='j1'><multiplier>3</multiplier><offset>0.1</offset>"
    mimic += "<reference>0.02</reference></mimic>"
    fingers = finger.format(1, "") + finger.format(2, mimic)
    file = write(sdf_text.replace("</model>", f"{fingers}</model>"), "arm.sdf")
    refused(lambda: read(file), "'j2'", "mimic = j1", "fixed_joints: {j1: VALUE}")
    plant, _ = read(file, fixed_joints={"j1": 0.05})
    context = plant.CreateDefaultContext()
    between = plant.GetFrameByName("f2").CalcPose(context, plant.GetFrameByName("f1"))
    assert between.translation() == pytest.approx([0, 0, 0.19 - 0.05], abs=1e-15)
    body = "<body name='{0}'><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/>"
    body += "<joint name='j_{0}' type='{1}' axis='0 0 1' range='-1 1'/>"
    text = (
        "<mujoco model='arm'><compiler angle='radian'/><worldbody>"
        + body.format("arm", "hinge")
        + body.format("left", "slide")
        + "</body>"
        + body.format("right", "slide")
        + "</body></body></worldbody><equality>{}</equality>"
        + "<actuator><motor joint='j_arm'/></actuator></mujoco>"
    )
    tie = "<joint joint1='j_right' joint2='j_left' polycoef='0.1 -1 0 0 0'/>"
    file = write(text.format(tie), "arm.xml")
    refused(lambda: read(file), "'j_right'", "mimic = j_left", "fixed_joints: {j_left: VALUE}")
    plant, _ = read(file, fixed_joints={"j_left": 0.3})
    context = plant.CreateDefaultContext()
    between = plant.GetFrameByName("right").CalcPose(context, plant.GetFrameByName("left"))
    assert between.translation() == pytest.approx([0, 0, -0.2 - 0.3], abs=1e-15)
    file = write(text.format("<weld body1='left' body2='right'/>"), "arm.xml")
    refused(lambda: read(file, fixed_joints={"j_left": 0.3}), "an open chain without constraints")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("arm.dae", "<robot/>"),
        ("arm.xml", "<robot/>"),
        ("arm.sdf", "<robot/>"),
        ("arm.urdf", "<sdf/>"),
        ("arm.urdf", "<robot/>"),
        ("arm.sdf", "<sdf version='1.9'><model name='x'/></sdf>"),
        ("arm.sdf", "<sdf version='x'/>"),
    ],
)
def test_files_of_another_kind(write, read, refused, name, text):
    file = write(text, name)
    refused(lambda: read(file), file, "cannot be read: ")


def test_conditions_that_end_the_program_in_drake(write, read, refused, urdf_text):
    """A joint to a link that does not exist; a link that is its own parent."""
    file = write(urdf_text.replace('<child link="lower"/>', '<child link="nope"/>', 1))
    refused(lambda: read(file), file, "cannot be read", "nope")
    file = write(urdf_text.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 0 0"/>', 1))
    refused(lambda: read(file), file, "cannot be read", "elbow")


def test_geometry_is_not_needed_to_move(write, read, urdf_text):
    """Meshes of an unknown package, a box of negative size."""
    visual = (
        '<visual><geometry><mesh filename="package://nowhere/x.dae"/></geometry></visual>'
        '<collision><geometry><box size="-1 1 1"/></geometry></collision></link>'
    )
    plant, warnings = read(write(urdf_text.replace("</link>", visual)))
    assert plant.num_positions() == 2 and warnings == []


def test_mjcf(write, read):
    text = """<mujoco model="m"><worldbody><body name="a"><inertial pos="0 0 1" mass="1"
    diaginertia="1 1 1"/><joint name="j" type="hinge" axis="1 0 0" range="-90 90"/>
    <site name="s"/></body></worldbody></mujoco>"""
    plant, _ = read(write(text, "arm.xml"))
    chain, coordinates = chain_of(plant, "a")
    assert chain.names == ["j"] and coordinates.actuators.tolist() == [0]
    assert chain.gather("effort_limit").tolist() == [np.inf]


def test_shipped_models_give_no_warnings():
    for name in ("comau_racer_1_4", "comau_racer_1_4_elastic"):
        plant = MultibodyPlant(0.0)
        scene_graph = SceneGraph()
        plant.RegisterAsSourceForSceneGraph(scene_graph)
        assert read_model(plant, resolve_model(name)) == []


WRITTEN = "<drake:rotor_inertia>0.000611</drake:rotor_inertia>"


@pytest.mark.parametrize(
    ("old", "new"), [(WRITTEN, ""), (WRITTEN, "<drake:rotor_inertia>0</drake:rotor_inertia>")]
)
def test_motors_of_elastic_joints_without_inertia(write, read, refused, old, new):
    text = resolve_model("comau_racer_1_4_elastic_3r").read_text(encoding="utf-8")
    assert old in text
    file = write(text.replace(old, new), "arm.sdf")
    refused(lambda: read(file), file, "'motor_1'", "rotor_inertia", "positive")


def test_default_moments_of_sdf_are_reported(write, read, sdf_text):
    moments = "<inertia><ixx>0.02</ixx><iyy>0.02</iyy><izz>0.01</izz></inertia>"
    first, second, third = sdf_text.split(moments)
    plant, (warning,) = read(write(first + moments + second + third, "arm.sdf"))
    assert warning.endswith("SDF takes 1 kg m^2 for moments of arm")
    inertia = plant.GetBodyByName("arm").default_rotational_inertia().get_moments()
    np.testing.assert_allclose(inertia, [1.02, 1.02, 1.0], rtol=1e-12)
