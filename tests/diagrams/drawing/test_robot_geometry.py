"""Drawing robots that their makers wrote in all manners."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import Box, Cylinder, Mesh

from diagrams.drawing.robot_geometry import draw_robot
from diagrams.robots.model import read_robot, tool_frame
from diagrams.scenario import RobotParameters
from pfsc_drake.systems.drawing.robot_visualizer import Triangles

INERTIAL = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
)
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
COLLADA = (
    '<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema">'
    "<library_geometries><geometry><mesh/></geometry></library_geometries></COLLADA>"
)
PLATE = '<geometry><box size="0.1 0.2 0.3"/></geometry>'


def stl():
    """One triangle with a corner at 100 mm."""
    corners = [0, 0, 0, 100, 0, 0, 0, 100, 0]
    return b"mm".ljust(80) + struct.pack("<I12fH", 1, 0, 0, 1, *corners, 0)


def mesh(address, more=""):
    return f'<geometry><mesh filename="{address}" {more}/></geometry>'


def visual(geometry, material=""):
    return f"<visual>{geometry}{material}</visual>"


def urdf(link_1, link_2="", top=""):
    joints = "".join(
        f'<joint name="joint_{i}" type="revolute"><parent link="{parent}"/>'
        f'<child link="link_{i}"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>'
        f'<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>'
        for i, parent in ((1, "world"), (2, "link_1"))
    )
    return (
        f'<robot name="arm">{top}<link name="world"/>{joints}<link name="link_1">{INERTIAL}{link_1}'
        f'</link><link name="link_2">{INERTIAL}{link_2}</link></robot>'
    )


@pytest.fixture
def draw(tmp_path):
    """Return a function that writes a model in a package ``my_arm`` and says how it is drawn."""

    def drawn(model, files=None, name="arm.urdf"):
        folder = tmp_path / "my_arm" / "urdf"
        folder.mkdir(parents=True)
        (tmp_path / "my_arm/package.xml").write_text(
            "<package><name>my_arm</name><version>1.0.0</version></package>"
        )
        (folder / name).write_text(model)
        for file, content in (files or {}).items():
            target = tmp_path / "my_arm" / file
            target.parent.mkdir(exist_ok=True)
            target.write_bytes(content if isinstance(content, bytes) else content.encode())
        parameters = RobotParameters(f"my_arm/urdf/{name}", "link_2")
        # the plant that is simulated takes the model whatever its geometry is
        plant, _ = read_robot(parameters, tmp_path)
        assert not plant.geometry_source_is_registered()
        return draw_robot(plant, tool_frame(plant, parameters), parameters, tmp_path)

    return drawn


def sticks(drawing):
    return [part for part in drawing.parts if part.name.startswith(("stick", "joint", "tool"))]


def looks(drawing, body):
    return [p for p in drawing.parts if p.body.name() == body and p not in sticks(drawing)]


def test_shipped_robots_are_drawn_as_their_makers_say(load_arm):
    for model in ("comau_racer_1_4", "comau_racer_1_4_elastic", "comau_racer_1_4_elastic_3r"):
        arm = load_arm(model)
        drawing = draw_robot(arm.plant, arm.tool, RobotParameters(model), Path())
        assert drawing.plant is arm.plant
        assert not drawing.warnings and not sticks(drawing)
        assert len(drawing.parts) > 10
        assert {part.body.name() for part in drawing.parts} >= {"link_1", "link_2", "link_3"}


def test_shapes_colours_and_poses_are_those_of_the_model(draw):
    red = '<material name="red"><color rgba="1 0 0 1"/></material>'
    placed = f'<origin xyz="0 0 0.2" rpy="0 0 1"/>{PLATE}'
    drawing = draw(urdf(visual(placed, red), visual(PLATE)))
    (box,), (plain,) = looks(drawing, "link_1"), looks(drawing, "link_2")
    assert isinstance(box.form, Box)
    np.testing.assert_array_equal(box.form.size(), [0.1, 0.2, 0.3])
    np.testing.assert_allclose(box.X_BP.translation(), [0, 0, 0.2], atol=1e-15)
    np.testing.assert_allclose(box.X_BP.rotation().col(0), [np.cos(1), np.sin(1), 0], atol=1e-12)
    assert (box.color.r(), box.color.g(), box.color.b()) == (1.0, 0.0, 0.0)
    assert plain.color.r() == plain.color.g() == plain.color.b() == 0.9
    assert not drawing.warnings and not sticks(drawing)


@pytest.mark.parametrize(
    "address",
    ["package://my_arm/meshes/part.stl", "../meshes/part.stl"],
)
def test_stl_meshes_are_drawn_in_metres(draw, address):
    look = visual(mesh(address, 'scale="0.001 0.001 0.002"'))
    drawing = draw(urdf(look, visual(PLATE)), {"meshes/part.stl": stl()})
    (part,) = looks(drawing, "link_1")
    assert isinstance(part.form, Triangles)
    np.testing.assert_allclose(part.form.vertices.max(axis=0), [0.1, 0.1, 0.0], atol=1e-9)
    assert not drawing.warnings and not sticks(drawing)


def test_other_meshes_are_drawn_by_their_geometry(draw):
    gltf = json.dumps({"asset": {"version": "2.0"}, "meshes": [{"primitives": []}]})
    files = {"meshes/a.OBJ": OBJ, "meshes/b.dae": COLLADA, "meshes/c.gltf": gltf}
    look = "".join(visual(mesh(f"package://my_arm/{file}")) for file in files)
    drawing = draw(urdf(look), files)
    assert all(isinstance(part.form, Mesh) for part in drawing.parts)
    names = [part.form.source().in_memory().mesh_file.filename_hint() for part in drawing.parts]
    assert sorted(names) == ["a.OBJ", "b.dae", "c.gltf"]
    assert not drawing.warnings


@pytest.mark.parametrize(
    ("file", "content", "reason"),
    [
        ("part.stl", None, "no such file"),
        ("part.stl", b"solid nothing", "holds no triangles"),
        ("part.obj", "nothing", "holds no mesh"),
        ("part.dae", "<COLLADA/>", "holds no mesh"),
        ("part.dae", "<COLLADA", "holds no mesh"),
        ("part.gltf", "{", "holds no mesh"),
        ("part.gltf", "[]", "holds no mesh"),
        ("part.gltf", '{"meshes": [3], "buffers": [{"uri": 5}], "images": "x"}', "holds no mesh"),
        ("part.step", "x", "drawn are obj, gltf, dae and stl"),
        ("part.glb", "x", "drawn are obj, gltf, dae and stl"),
    ],
)
def test_what_cannot_be_drawn_is_one_line_and_sticks_stand_in(draw, file, content, reason):
    files = {} if content is None else {f"meshes/{file}": content}
    look = visual(mesh(f"package://my_arm/meshes/{file}"))
    drawing = draw(urdf(look, visual(PLATE)), files)
    (warning,) = drawing.warnings
    for part in ("link_1", file, reason):
        assert part in warning
    assert "\n" not in warning
    assert not looks(drawing, "link_1") and len(looks(drawing, "link_2")) == 1
    assert {part.body.name() for part in sticks(drawing)} == {"world", "link_1", "link_2"}


def test_a_package_that_is_not_known_is_said_once(draw):
    look = visual(mesh("package://elsewhere/part.stl"))
    drawing = draw(urdf(look + look, look))
    (warning,) = drawing.warnings
    assert "link_1, link_2" in warning and "'elsewhere'" in warning


def test_a_package_of_ros_is_found(draw, tmp_path, monkeypatch):
    other = tmp_path / "ros" / "looks"
    other.mkdir(parents=True)
    (other / "package.xml").write_text("<package><name>looks</name></package>")
    (other / "part.obj").write_text(OBJ)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ros"))
    drawing = draw(urdf(visual(mesh("package://looks/part.obj"))))
    assert not drawing.warnings and len(drawing.parts) == 1


def test_materials_of_one_name_keep_their_colours(draw):
    colours = ["1 0 0 1", "0 1 0 1", "0 0 1 1"]
    looks_of = [
        visual(PLATE, f'<material name="grey"><color rgba="{rgba}"/></material>')
        for rgba in colours
    ]
    again = visual(PLATE, '<material name="grey"/>')
    drawing = draw(urdf("".join(looks_of), again))
    drawn = {(p.color.r(), p.color.g(), p.color.b()) for p in looks(drawing, "link_1")}
    assert drawn == {(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)}
    (referring,) = looks(drawing, "link_2")
    assert referring.color.r() == 1.0  # the first of that name
    assert not drawing.warnings


def test_textures_go_also_from_materials_that_are_named_apart(draw):
    looks_of = [
        visual(
            PLATE,
            f'<material name="m">\n<color rgba="{rgba}"/><texture filename="no.png"/></material>',
        )
        for rgba in ("1 0 0 1", "0 1 0 1")
    ]
    drawing = draw(urdf("".join(looks_of), visual(PLATE)))
    drawn = {(p.color.r(), p.color.g(), p.color.b()) for p in looks(drawing, "link_1")}
    assert drawn == {(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)}
    assert not drawing.warnings


def test_materials_that_a_robot_repeats(draw):
    grey = '<material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>'
    drawing = draw(urdf(visual(PLATE, '<material name="grey"/>'), top=grey * 3))
    (part,) = looks(drawing, "link_1")
    assert part.color.r() == 0.5
    assert not drawing.warnings


def test_collision_geometry_hinders_nothing(draw):
    collision = f"<collision>{mesh('package://my_arm/meshes/hull.stl')}</collision>"
    drawing = draw(urdf(visual(PLATE) + collision, visual(PLATE)))
    assert len(drawing.parts) == 2 and not drawing.warnings


def test_a_model_without_looks_is_a_stick_figure(draw):
    drawing = draw(urdf(""))
    assert not drawing.warnings  # nothing is amiss
    assert drawing.parts == sticks(drawing)
    assert any(isinstance(part.form, Cylinder) for part in drawing.parts)


def test_geometry_that_drake_refuses_is_one_line(draw):
    drawing = draw(urdf(visual("<geometry><sphere/></geometry>"), visual(PLATE)))
    (warning,) = drawing.warnings
    assert "the model's geometry is not drawn" in warning and "\n" not in warning
    assert drawing.parts == sticks(drawing)


def test_sdf_models_are_read_alike(draw):
    inertia = "<inertial><mass>1</mass></inertial>"

    def link(name, file):
        return (
            f"<link name='{name}'>{inertia}<visual name='v'><geometry><mesh>"
            f"<uri>package://my_arm/meshes/{file}</uri></mesh></geometry></visual></link>"
        )

    joints = "".join(
        f"<joint name='joint_{i}' type='revolute'><parent>{parent}</parent>"
        f"<child>link_{i}</child><axis><xyz>0 1 0</xyz></axis></joint>"
        for i, parent in ((1, "world"), (2, "link_1"))
    )
    model = (
        f"<sdf version='1.9'><model name='arm'>{link('link_1', 'part.stl')}"
        f"{link('link_2', 'none.obj')}{joints}</model></sdf>"
    )
    drawing = draw(model, {"meshes/part.stl": stl()}, "arm.sdf")
    (part,) = looks(drawing, "link_1")
    assert isinstance(part.form, Triangles)
    (warning,) = drawing.warnings
    assert "link_2" in warning and "none.obj: no such file" in warning


@pytest.mark.parametrize(
    "address", ["{0}/part.obj", "file://{0}/part.obj", "../../../{1}/part.obj"]
)
def test_meshes_outside_the_packages_are_one_line(draw, tmp_path_factory, address):
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / "part.obj").write_text(OBJ)
    look = visual(mesh(address.format(elsewhere, elsewhere.name)))
    drawing = draw(urdf(look, visual(PLATE)))
    (warning,) = drawing.warnings
    assert "link_1" in warning and "outside the model's packages" in warning
    assert not looks(drawing, "link_1") and len(looks(drawing, "link_2")) == 1


def test_a_package_is_not_left_by_its_address(draw, tmp_path):
    (tmp_path / "part.obj").write_text(OBJ)
    (warning,) = draw(urdf(visual(mesh("package://my_arm/../part.obj")))).warnings
    assert "outside the model's packages" in warning


def test_a_texture_that_is_missing_hinders_nothing(draw):
    """Neither of the robot nor of its drawing: the model is read twice."""
    textured = '<material name="black"><texture filename="package://my_arm/no.png"/></material>'
    coloured = '<material name="red"><color rgba="1 0 0 1"/><texture filename="no.png"/></material>'
    names = [f'<material name="{name}"/>' for name in ("black", "red")]
    drawing = draw(urdf(*(visual(PLATE, name) for name in names), top=textured + coloured))
    (black,), (red,) = looks(drawing, "link_1"), looks(drawing, "link_2")
    assert (black.color.r(), black.color.g()) == (0.7, 0.7)
    assert (red.color.r(), red.color.g()) == (1.0, 0.0)
    assert not drawing.warnings
