"""Which mesh files can be drawn, and why others cannot."""

import json
from pathlib import Path as FilePath
from xml.etree import ElementTree

from pydrake.geometry import Mesh, Meshcat, MeshcatParams

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.files.stl import read_stl
from pfsc_drake.systems.drawing.robot_visualizer import Surface

_DRAWN = "obj, gltf, dae and stl"


def drawn_mesh(mesh: Mesh) -> Mesh | Surface:
    """Return what to draw for a mesh of a model: itself, or the triangles of an STL file.

    Args:
        mesh: The mesh as read by Drake, from a file.

    Raises:
        InputError: If its file cannot be drawn.
    """
    file = FilePath(mesh.source().path())
    check_mesh_file(file)
    if file.suffix.lower() != ".stl":
        return mesh
    vertices, triangles = read_stl(file)
    return Surface(vertices * mesh.scale3(), triangles)


def check_mesh_file(file: FilePath) -> None:
    """Refuse a file that would not be drawn, or not in the browser.

    Args:
        file: The file.

    Raises:
        InputError: If it is missing, of another kind or not what its name says.
    """
    if not file.is_file():
        raise InputError(f"{file}: no such file")
    checks = {".obj": _is_obj, ".gltf": _is_gltf, ".dae": _is_collada, ".stl": _is_stl}
    check = checks.get(file.suffix.lower())
    if check is None:
        raise InputError(f"{file}: meshes of this kind are not drawn; drawn are {_DRAWN}")
    try:
        readable = check(file)
    except OSError as error:
        raise InputError(f"{file}: {error.strerror}") from None
    if not readable:
        raise InputError(f"{file}: holds no mesh that could be drawn")


def _is_obj(file: FilePath) -> bool:
    lines = file.read_bytes().splitlines()
    return all(any(line.lstrip().startswith(key) for line in lines) for key in (b"v ", b"f "))


def _is_gltf(file: FilePath) -> bool:
    try:
        content = json.loads(file.read_bytes())
    except ValueError:
        return False
    if not isinstance(content, dict) or not content.get("meshes"):
        return False
    try:  # no other kind of file makes Meshcat raise
        Meshcat(MeshcatParams(host="localhost")).SetObject("mesh", Mesh(str(file)))
    except RuntimeError:
        return False
    return True


def _is_collada(file: FilePath) -> bool:
    try:
        root = ElementTree.parse(file).getroot()
    except ElementTree.ParseError:
        return False
    return root.tag.endswith("COLLADA") and root.find(".//{*}geometry/{*}mesh") is not None


def _is_stl(file: FilePath) -> bool:
    """Readers of STL files say best what is wrong with one."""
    return True
