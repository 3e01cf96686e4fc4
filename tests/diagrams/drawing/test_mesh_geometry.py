"""Meshes reduced to their geometry: no other file is read."""

import base64
import json

import numpy as np
import pytest
from pydrake.geometry import Mesh, Meshcat, MeshcatParams, Rgba

from diagrams.drawing.mesh_geometry import NoMesh, geometry_of, in_memory
from pfsc_drake import InputError

SECRET = "somebody's secret"
OBJ = "mtllib ../secret.mtl\n usemtl m\nv 0 0 0\nv 2 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n"
CORNERS = np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0]], dtype="<f4").tobytes()
COLLADA = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema">
<library_images><image id="i"><init_from>../secret.png</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON><technique sid="t"><phong><diffuse>{diffuse}
</diffuse></phong></technique></profile_COMMON></effect></library_effects>
<library_geometries><geometry><mesh/></geometry></library_geometries></COLLADA>"""


def gltf(uri, **more):
    return json.dumps(
        {
            "asset": {"version": "2.0", "extras": SECRET},
            "buffers": [{"byteLength": 36, "uri": uri}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
            "materials": [
                {
                    "pbrMetallicRoughness": {
                        "baseColorFactor": [1, 0, 0, 1],
                        "baseColorTexture": {"index": 0},
                    }
                }
            ],
            "images": [{"uri": "../secret.png"}],
            "textures": [{"source": 0}],
        }
        | more
    )


@pytest.fixture
def write(tmp_path):
    """Return a function that writes a mesh beside which there is a secret."""
    (tmp_path / "meshes").mkdir()
    for name in ("secret.mtl", "secret.png", "secret.bin"):
        (tmp_path / name).write_text(f"newmtl m\nmap_Kd secret.png\n# {SECRET}")

    def written(name, content):
        file = tmp_path / "meshes" / name
        file.write_bytes(content if isinstance(content, bytes) else content.encode())
        return file

    return written


def drawn(file):
    """Return the recording of a mesh, less the player."""
    meshcat = Meshcat(MeshcatParams(host="localhost"))
    before = len(meshcat.StaticHtml())
    meshcat.SetObject("mesh", in_memory(file, Mesh(str(file), [1.0, 2.0, 3.0])), Rgba(1, 0, 0))
    page = meshcat.StaticHtml()
    assert len(page) > before + 100
    return page


def test_materials_of_obj_are_left_out(write):
    file = write("part.obj", OBJ)
    lines = geometry_of(file).splitlines()
    assert lines == [b"v 0 0 0", b"v 2 0 0", b"v 0 1 0", b"vt 0 0", b"f 1/1 2/1 3/1"]
    hidden = base64.b64encode(SECRET.encode()[3:15]).decode()
    assert SECRET not in drawn(file) and hidden not in drawn(file)
    np.testing.assert_array_equal(in_memory(file, Mesh(str(file), 3.0)).scale3(), np.full(3, 3.0))


def test_buffers_of_gltf_are_taken_in_and_textures_left_out(write):
    write("part one.bin", CORNERS)
    content = json.loads(geometry_of(write("part.gltf", gltf("part%20one.bin"))))
    uri = content["buffers"][0]["uri"]
    assert base64.b64decode(uri.rpartition(",")[2]) == CORNERS
    assert "images" not in content and "textures" not in content
    assert content["materials"] == [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}]
    assert "secret" not in json.dumps(content)
    file = write("own.gltf", gltf(uri))
    assert json.loads(geometry_of(file)) == content
    assert "secret" not in drawn(file)


@pytest.mark.parametrize(
    "uri",
    [
        "../secret.bin",
        "http://127.0.0.1:1/x.bin",
        "missing.bin",
        "/etc/passwd",
        "%2e%2e/secret.bin",
    ],
)
def test_buffers_elsewhere_are_refused(write, uri):
    with pytest.raises(InputError, match=r"part\.gltf: its buffer .* is no file in its folder"):
        geometry_of(write("part.gltf", gltf(uri)))


def test_a_buffer_behind_a_link_is_refused(write, tmp_path):
    (tmp_path / "meshes" / "link.bin").symlink_to(tmp_path / "secret.bin")
    with pytest.raises(InputError, match="no file in its folder"):
        geometry_of(write("part.gltf", gltf("link.bin")))
    with pytest.raises(InputError, match="needs extensions"):
        geometry_of(write("part.gltf", gltf("link.bin", extensionsRequired=["any"])))


def test_images_of_collada_are_left_out_and_colours_stay(write):
    textured = geometry_of(write("a.dae", COLLADA.format(diffuse='<texture texture="i"/>')))
    assert b"secret" not in textured and b"texture" not in textured
    coloured = geometry_of(write("b.dae", COLLADA.format(diffuse="<color>1 0 0 1</color>")))
    assert b"<color>1 0 0 1</color>" in coloured and b"secret" not in coloured
    assert b'xmlns="http://www.collada.org/2005/11/COLLADASchema"' in coloured


@pytest.mark.parametrize("name", ["part.obj", "part.gltf", "part.dae"])
@pytest.mark.parametrize("content", ["", "[" * 200_000, '{"meshes": ' * 50_000, "<a>" * 200_000])
def test_nonsense_is_no_mesh(write, name, content):
    with pytest.raises(NoMesh):
        geometry_of(write(name, content))
