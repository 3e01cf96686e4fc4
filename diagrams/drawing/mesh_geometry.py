"""Meshes reduced to their geometry, so that a recording holds nothing else of a user's files.

OBJ, glTF and Collada files name further files: materials, textures, buffers. Only the buffers of a
glTF file are read, in its folder or below. The reduced files refer to no other file.
"""

import base64
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree

from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh

from pfsc_drake.errors import InputError
from pfsc_drake.systems.drawing.hidden_meshcat import hidden_meshcat

_OBJ_WORDS = {b"v", b"vn", b"vt", b"f", b"o", b"g", b"s"}
_GLTF_KEYS = (
    *("asset", "scene", "scenes", "nodes", "meshes", "accessors", "bufferViews", "buffers"),
    "materials",
)
# keys of objects in a glTF file that are dropped everywhere
_GLTF_LEFT_OUT = ("extensions", "extras", "camera", "skin", "targets")
_GLTF_FACTORS = ("baseColorFactor", "metallicFactor", "roughnessFactor")
_COLLADA_LEFT_OUT = ("library_images", "newparam", "texture", "extra")
_DATA = "data:"


class NoMesh(Exception):
    """Error of a file that holds no mesh of the kind that its suffix names."""


def geometry_of(file: Path) -> bytes:
    """Return a mesh file reduced to geometry and colours.

    Args:
        file: An OBJ, glTF or Collada file.

    Raises:
        NoMesh: If it holds no mesh.
        InputError: If a glTF file names buffers that are not in its folder.
    """
    return _REDUCED[file.suffix.lower()](file)


def in_memory(file: Path, mesh: Mesh) -> Mesh:
    """Return the geometry of a mesh of a model, in no file.

    Args:
        file: Its file.
        mesh: The mesh as read by Drake.

    Raises:
        NoMesh: If the file holds none.
        InputError: See :func:`geometry_of`.
    """
    content = MemoryFile(geometry_of(file), file.suffix.lower(), file.name)
    return Mesh(InMemoryMesh(mesh_file=content), mesh.scale3())


def _obj(file: Path) -> bytes:
    lines = [line.lstrip() for line in file.read_bytes().splitlines()]
    reduced = [line for line in lines if line.split(None, 1)[:1] and line.split()[0] in _OBJ_WORDS]
    if not all(any(line.startswith(key) for line in reduced) for key in (b"v ", b"f ")):
        raise NoMesh
    return b"\n".join(reduced)


def _gltf(file: Path) -> bytes:
    try:
        content = json.loads(file.read_bytes())
    except (ValueError, RecursionError):
        raise NoMesh from None
    if not isinstance(content, dict) or not content.get("meshes"):
        raise NoMesh
    if content.get("extensionsRequired"):
        raise InputError(f"{file}: needs extensions of glTF; allowed: a mesh without")
    reduced = {key: _plain(content[key]) for key in _GLTF_KEYS if key in content}
    try:
        reduced["materials"] = [_colour(material) for material in reduced.get("materials", [])]
        for buffer in reduced.get("buffers", []):
            buffer["uri"] = _buffer(file, buffer["uri"])
        text = json.dumps(reduced).encode()
        # Meshcat raises for broken files of this kind only
        mesh = Mesh(InMemoryMesh(mesh_file=MemoryFile(text, ".gltf", file.name)))
        hidden_meshcat().SetObject("mesh", mesh)
    except (AttributeError, KeyError, TypeError, RuntimeError):  # of another structure
        raise NoMesh from None
    return text


def _plain(value: Any) -> Any:
    """Return a part of a glTF file without the keys that are dropped."""
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items() if key not in _GLTF_LEFT_OUT}
    return value


def _colour(material: dict[str, Any]) -> dict[str, Any]:
    """Return a material without textures."""
    rough = material.get("pbrMetallicRoughness", {})
    return {"pbrMetallicRoughness": {key: rough[key] for key in _GLTF_FACTORS if key in rough}}


def _buffer(file: Path, address: str) -> str:
    """Return a buffer of a glTF file as a data URI.

    Raises:
        InputError: If it is not in the file's folder.
    """
    if address.startswith(_DATA):
        return address
    folder = file.resolve().parent
    path = (folder / unquote(address)).resolve()
    if "://" in address or folder not in path.parents or not path.is_file():
        raise InputError(f"{file}: its buffer {address!r} is no file in its folder")
    content = base64.b64encode(path.read_bytes()).decode()
    return f"{_DATA}application/octet-stream;base64,{content}"


def _collada(file: Path) -> bytes:
    try:
        root = ElementTree.fromstring(file.read_bytes())
    except (ElementTree.ParseError, RecursionError):
        raise NoMesh from None
    if not root.tag.endswith("COLLADA") or root.find(".//{*}geometry/{*}mesh") is None:
        raise NoMesh
    root.set("xmlns", root.tag.rpartition("}")[0].lstrip("{"))
    for parent in list(root.iter()):
        parent.tag = parent.tag.rpartition("}")[2]
        for child in list(parent):
            if child.tag.rpartition("}")[2] in _COLLADA_LEFT_OUT:
                parent.remove(child)
    return ElementTree.tostring(root)


_REDUCED: dict[str, Callable[[Path], bytes]] = {".obj": _obj, ".gltf": _gltf, ".dae": _collada}
