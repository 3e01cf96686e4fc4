"""Mesh files of MJCF models in Drake's format: OBJ files, by absolute names."""

import atexit
import hashlib
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.files.mesh_files import read_stl
from pfsc_drake.robot.models.model_xml import Element, ModelXml


def mesh_files(model: ModelXml, *, always: bool = False) -> Iterator[tuple[Element, Path | None]]:
    """Iterate over meshes of an MJCF model and their OBJ files; None for a missing one.

    STL files are converted; outside the folder above the model's they count as missing. Nothing is
    generated if Drake can use all files unchanged, unless ``always``.

    Args:
        model: The model.
        always: Whether file names have to become absolute.

    Raises:
        InputError: If an STL file cannot be read.
    """
    if model.root.name != "mujoco":
        return
    folder = _mesh_folder(model)
    named = [mesh for mesh in model.root.all("asset", "mesh") if "file" in mesh.attributes]
    files = {id(mesh): folder / mesh.attributes["file"] for mesh in named}
    if not always and all(
        file.suffix.lower() == ".obj" and file.is_file() for file in files.values()
    ):
        return
    for mesh in named:
        file = files[id(mesh)]
        if not file.is_file():
            yield mesh, None
        elif file.suffix.lower() != ".stl":
            yield mesh, file.resolve()
        else:
            # files from elsewhere must not become part of a drawing
            above = model.file.resolve().parent.parent
            yield mesh, as_obj(file) if above in file.resolve().parents else None


def mesh_name(mesh: Element) -> str:
    """Return the name of a mesh: by default its file's name without suffix."""
    return mesh.attributes.get("name", Path(mesh.attributes.get("file", "")).stem)


def _mesh_folder(model: ModelXml) -> Path:
    folder = model.file.resolve().parent
    for compiler in model.root.all("compiler"):
        attributes = compiler.attributes
        folder = folder / attributes.get("meshdir", attributes.get("assetdir", ""))
    return folder


def as_obj(file: Path) -> Path:
    """Return an OBJ file with the triangles of an STL file, stored until the process ends.

    Args:
        file: The STL file.

    Raises:
        InputError: If it cannot be read.
    """
    try:
        digest = hashlib.sha256(file.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"{file}: {error.strerror}") from None
    target = _mesh_cache() / f"{digest}.obj"
    if not target.exists():
        vertices, triangles = read_stl(file)
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist()]
        target.write_text("\n".join(lines) + "\n", encoding="ascii")
    return target


def is_converted(file: Path) -> bool:
    """Return whether a file was created by :func:`as_obj`."""
    return file.parent == _mesh_cache()


@cache
def _mesh_cache() -> Path:
    folder = tempfile.TemporaryDirectory(prefix="pfsc_drake_meshes_")
    atexit.register(folder.cleanup)
    return Path(folder.name)
