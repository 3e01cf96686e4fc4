"""Models that Drake can use only in another text."""

import pytest
from pydrake.geometry import Rgba, Role, SceneGraph
from pydrake.multibody.plant import MultibodyPlant

from pfsc_drake.robot.models.model_text import usable_text
from pfsc_drake.robot.models.model_xml import read_model_xml
from pfsc_drake.robot.models.reading import read_model

GREY = '<material name="grey"><color rgba="{} 0.5 0.5 1"/></material>'
BOX = "<visual><geometry><box size='1 1 1'/></geometry>{}</visual></link>"


def colours(file):
    """Return the red of all that is drawn, by the name of the body."""
    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    warnings = read_model(plant, file)
    assert warnings == []
    inspector = scene_graph.model_inspector()
    red = {}
    for identity in inspector.GetAllGeometryIds(Role.kIllustration):
        properties = inspector.GetIllustrationProperties(identity)
        colour = properties.GetPropertyOrDefault("phong", "diffuse", Rgba())
        red.setdefault(plant.GetBodyFromFrameId(inspector.GetFrameId(identity)).name(), []).append(
            colour.r()
        )
    return red


def test_materials_of_one_name(write, urdf_text):
    text = urdf_text.replace('"arm">', '"arm">' + GREY.format(0.1) * 3, 1)
    for red in (0.1, 0.8):
        text = text.replace("</inertial></link>", "</inertial>" + BOX.format(GREY.format(red)), 1)
    assert colours(write(text)) == {"upper": [0.1], "lower": [0.8]}


def test_ordinary_files_stay_as_they_are(write, urdf_text, sdf_text):
    once = urdf_text.replace('"arm">', '"arm">' + GREY.format(0.1), 1)
    written_otherwise = '<material  name="grey">\n<color rgba="0.1  0.5 0.5 1"/></material>'
    once = once.replace("</inertial></link>", "</inertial>" + BOX.format(written_otherwise), 1)
    assert usable_text(read_model_xml(write(once))) is None
    assert usable_text(read_model_xml(write(sdf_text, "arm.sdf"))) is None


def test_lines_stay_and_names_become_absolute(write, tmp_path, urdf_text):
    long = GREY.format(0.5).replace("><", ">\n<")
    mesh = "<visual><geometry><mesh filename='meshes/a &amp; b.obj'/></geometry></visual></link>"
    text = urdf_text.replace('"arm">', '"arm">' + long * 2, 1).replace("</link>", mesh, 1)
    edited = usable_text(read_model_xml(write(text)))
    assert edited.count("\n") == text.count("\n")
    assert edited.count("<material") == 1
    line = text[: text.index("shoulder")].count("\n")
    assert edited[: edited.index("shoulder")].count("\n") == line
    again = read_model_xml(write(edited, "again.urdf"))
    (address,) = (e.attributes["filename"] for e in again.root.within() if e.name == "mesh")
    assert address == str(tmp_path / "meshes/a & b.obj")


@pytest.mark.parametrize("uri", ["meshes/a.obj", "package://x/a.obj"])
def test_springs_left_out(write, sdf_text, tmp_path, uri):
    mesh = f"<visual name='v'><geometry><mesh><uri>{uri}</uri></mesh></geometry></visual></link>"
    text = sdf_text.replace("<spring_stiffness>0<", "<spring_stiffness>70<")
    text = text.replace("</link>", mesh, 1)
    edited = usable_text(read_model_xml(write(text, "arm.sdf")), without_springs=True)
    assert "<spring_stiffness>0</spring_stiffness>" in edited
    address = uri if "://" in uri else str(tmp_path / uri)
    assert f"<uri>{address}</uri>" in edited
