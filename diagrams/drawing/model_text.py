"""A model file as it is read for drawing: what the parser would stumble over is taken out."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path as FilePath
from xml.dom import expatbuilder
from xml.dom.minidom import Document, Element, Text
from xml.parsers.expat import ExpatError

from diagrams.drawing.model_meshes import check_mesh_file
from pfsc_drake.errors import InputError

Resolve = Callable[[str], FilePath]


@dataclass(frozen=True)
class NotDrawn:
    """A link that cannot be drawn, at least in part.

    Attributes:
        link: Its name.
        reason: Why, naming the file.
    """

    link: str
    reason: str


def drawable_text(file: FilePath, resolve: Resolve) -> tuple[str, list[NotDrawn]]:
    """Return the text of a URDF or SDF file without all that hinders drawing.

    Collision geometry goes, for it is not drawn and may be of kinds that only other parsers
    take. Visual meshes that cannot be drawn go. Mesh addresses become absolute. A material that
    is defined again with another content gets a name of its own; textures go.

    Args:
        file: The model.
        resolve: From the address of a mesh to its file; may raise InputError.

    Returns:
        The text, and what cannot be drawn.

    Raises:
        InputError: If the file is no XML.
    """
    try:
        # without namespaces, since URDF files often do not declare the prefix "drake:"
        document = expatbuilder.parseString(file.read_bytes(), namespaces=False)
    except (ExpatError, ValueError, OSError) as error:
        raise InputError(f"{file}: {error}") from None
    for collision in list(document.getElementsByTagName("collision")):
        _remove(collision)
    _part_materials(document)
    missing = []
    for visual in list(document.getElementsByTagName("visual")):
        for mesh in visual.getElementsByTagName("mesh"):
            try:
                _locate(mesh, resolve)
            except InputError as error:
                missing.append(NotDrawn(_name_of_link(visual), str(error)))
                _remove(visual)
                break
    return document.toxml(), missing


def _locate(mesh: Element, resolve: Resolve) -> None:
    """Replace a mesh's address by its file.

    Raises:
        InputError: If that cannot be drawn.
    """
    addresses = mesh.getElementsByTagName("uri")  # SDF; URDF has an attribute
    text = addresses[0].firstChild if addresses else None
    written = text.data if isinstance(text, Text) else mesh.getAttribute("filename")
    file = resolve(written.strip())
    check_mesh_file(file)
    if isinstance(text, Text):
        text.data = f"file://{file.resolve()}"  # text has no folder for relative names
    else:
        mesh.setAttribute("filename", f"file://{file.resolve()}")


def _part_materials(document: Document) -> None:
    """Give a material that differs from an earlier one of its name a name of its own."""
    for texture in list(document.getElementsByTagName("texture")):
        _remove(texture)
    known: dict[str, str] = {}
    for number, material in enumerate(list(document.getElementsByTagName("material"))):
        name, colors = material.getAttribute("name"), material.getElementsByTagName("color")
        if not name or not colors:
            continue
        content = colors[0].getAttribute("rgba")
        if name in known and material.parentNode is document.documentElement:
            _remove(material)  # Drake takes each name once there, even with equal contents
        elif known.setdefault(name, content) != content:
            material.setAttribute("name", f"{name}#{number}")


def _name_of_link(visual: Element) -> str:
    link = visual.parentNode
    return link.getAttribute("name") if isinstance(link, Element) else ""


def _remove(element: Element) -> None:
    if element.parentNode is not None:
        element.parentNode.removeChild(element)
        element.unlink()
