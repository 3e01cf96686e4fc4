"""Text of a model that Drake can use, where it cannot use the file itself."""

import logging
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

from pfsc_drake.robot.models.mjcf_meshes import mesh_files, mesh_name
from pfsc_drake.robot.models.model_parts import mimic_elements
from pfsc_drake.robot.models.model_xml import Element, ModelXml

_GREY = '<color rgba="0.7 0.7 0.7 1"/>'
# an element and the text that it becomes
Edit = tuple[Element, str]


def usable_text(
    model: ModelXml, *, without_springs: bool = False, without_masses: bool = False
) -> str | None:
    """Return an edited text of a model, or None if Drake can use the file unchanged.

    ROS tools repeat a material wherever it is used, with colours that may differ; Drake refuses
    that, so such materials get different names. Textures are removed, because it refuses missing
    ones. STL meshes of MJCF models become OBJ meshes, missing ones are removed, and a model without
    a name gets one. Mimic elements are removed: followers are fixed at their leader's position.
    Springs can be removed, since Drake cannot remove joints from a plant with springs. Line numbers
    are unchanged. Relative file names become absolute, since a text has no folder.

    Args:
        model: The model.
        without_springs: Whether to set the stiffness of its joints to zero.
        without_masses: Whether to remove inertia of links and transmissions of a URDF model.
    """
    edits = list(distinct_materials(model))
    edits += [(mimic, "") for _, mimic in mimic_elements(model)]
    edits += without_textures(model)
    edits += (nameless := list(_named_mjcf(model)))
    edits += _usable_meshes(model, always=bool(nameless))
    if without_springs:
        edits += [
            (element, f"<{element.name}>0</{element.name}>")
            for element in model.root.within()
            if element.name == "spring_stiffness"
        ]
    if without_masses:
        left_out = [*model.root.all("link", "inertial"), *model.root.all("transmission")]
        edits += [(element, "") for element in left_out]
    return edited_text(model, [*edits, *absolute_names(model)]) if edits else None


def _named_mjcf(model: ModelXml) -> Iterator[Edit]:
    """Iterate over the edit that gives an MJCF model a name, which Drake requires."""
    root = model.root
    if root.name == "mujoco" and not root.attributes.get("model") and root.children:
        # its first tag alone
        yield replace(root, end=root.children[0].start), '<mujoco model="robot">'


def _usable_meshes(model: ModelXml, *, always: bool) -> Iterator[Edit]:
    """Iterate over edits of an MJCF model's meshes: readable files, and no missing ones."""
    missing = set()
    for mesh, file in mesh_files(model, always=always):
        if file is not None:
            yield with_attributes(mesh, file=str(file))
        else:
            missing.add(mesh_name(mesh))
            yield mesh, ""
    for geometry in (element for element in model.root.within() if element.name == "geom"):
        if geometry.attributes.get("mesh") in missing:
            yield geometry, ""


def edited_text(model: ModelXml, edits: Iterable[Edit]) -> str:
    """Return the text of a model with other text for some elements; line numbers are unchanged.

    Args:
        model: The model.
        edits: Elements and their new texts. Elements within another one are replaced with it.
    """
    parts, begin = [], 0
    for element, text in sorted(edits, key=lambda edit: (edit[0].start, -edit[0].end)):
        if element.start >= begin:
            # as many line breaks as before, so that messages name the right line
            lost = model.content[element.start : element.end].count(b"\n")
            parts += [model.content[begin : element.start], text.encode(), b"\n" * lost]
            begin = element.end
    return b"".join([*parts, model.content[begin:]]).decode("utf-8")


def distinct_materials(model: ModelXml) -> Iterator[Edit]:
    """Iterate over edits of a URDF model's repeated materials, which are renamed or removed.

    Args:
        model: The model.
    """
    if model.root.name != "robot":
        return
    known: dict[str, object] = {}
    at_root = list(model.root.all("material"))
    for material in [*at_root, *model.root.all("link", "visual", "material")]:
        name, look = material.attributes.get("name", ""), _look(material)
        if not name or not look:
            continue
        if name not in known:
            known[name] = look
        elif material in at_root:
            yield material, ""
        elif known[name] != look:
            # its first tag alone
            head = replace(material, end=material.children[0].start)
            yield head, f"<material name={quoteattr(f'{name}_{material.start}')}>"


def without_textures(model: ModelXml) -> Iterator[Edit]:
    """Iterate over edits of a URDF model's textures, which are removed or become grey.

    Args:
        model: The model.
    """
    if model.root.name != "robot":
        return
    for material in (element for element in model.root.within() if element.name == "material"):
        colour = "" if material.first("color") is not None else _GREY
        for texture in material.all("texture"):
            yield texture, colour
            colour = ""


def _look(material: Element) -> tuple[tuple[str, ...], ...]:
    """Return the look of a material: numbers of its colour, and its texture."""
    return tuple(
        (child.name, *(word for value in child.attributes.values() for word in value.split()))
        for child in material.children
    )


def absolute_names(model: ModelXml) -> Iterator[Edit]:
    """Iterate over edits of elements with relative file names, which become absolute.

    Args:
        model: The model.
    """
    folder = model.file.parent
    for element in model.root.within():
        address = element.attributes.get("filename", "")
        if element.name == "mesh" and address and "://" not in address:
            yield with_attributes(element, filename=str((folder / address).resolve()))
        if element.name == "uri" and "://" not in element.text:
            path = Path(folder / element.text.strip()).resolve()
            yield element, f"<uri>{escape(str(path))}</uri>"


def with_attributes(element: Element, **changed: str) -> Edit:
    """Return the edit of an element without children that changes attributes.

    Args:
        element: The element.
        **changed: Attributes by name.
    """
    attributes = "".join(
        f" {name}={quoteattr(value)}" for name, value in (element.attributes | changed).items()
    )
    return element, f"<{element.name}{attributes}/>"


# location of a failed condition in Drake's own sources, which does not help a user
_IN_DRAKE = re.compile(r"Failure at \S+ in (\w+)\(\): ")


class DrakeMessages(logging.Handler):
    """Distinct messages of Drake, one line each.

    Attributes:
        warnings: Its warnings.
        errors: Its errors that raised no exception.
    """

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.warnings: list[str] = []
        self.errors: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Store a message."""
        lines = self.errors if record.levelno >= logging.ERROR else self.warnings
        message = one_line(record.getMessage())
        if message not in lines:
            lines.append(message)


@contextmanager
def collected_messages() -> Iterator[DrakeMessages]:
    """Collect Drake's warnings and errors instead of printing them.

    Yields:
        Lists that grow.
    """
    messages = DrakeMessages()
    logger = logging.getLogger("drake")
    level, propagate, handlers = logger.level, logger.propagate, logger.handlers[:]
    logger.handlers[:] = [messages]
    logger.propagate = False
    logger.setLevel(logging.WARNING)
    try:
        yield messages
    finally:
        logger.handlers[:] = handlers
        logger.propagate = propagate
        logger.setLevel(level)


def one_line(text: object) -> str:
    """Return a message of Drake in one line, without locations in Drake's sources."""
    return _IN_DRAKE.sub(r"\1(): ", " ".join(str(text).split()))
