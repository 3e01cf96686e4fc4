"""Materials of a URDF file, which Drake wants to be named apart."""

from pathlib import Path
from xml.sax.saxutils import quoteattr

from pfsc_drake.robot.models.model_xml import Element, ModelXml


def with_distinct_materials(model: ModelXml) -> str | None:
    """Return a URDF in which no name stands for two materials, or None if it is one already.

    ROS tools repeat a material wherever it is used, and let the colour differ; Drake refuses
    that. Lines stay where they are. Mesh files are named by absolute paths, since a text has no
    folder.

    Args:
        model: The model.
    """
    if model.root.name != "robot":
        return None
    known: dict[str, object] = {}
    edits: list[tuple[Element, str]] = []
    at_root = list(model.root.all("material"))
    in_links = list(model.root.all("link", "visual", "material"))
    for material in [*at_root, *in_links]:
        name = material.attributes.get("name", "")
        look = _look(material)
        if not name or not look:
            continue
        if name not in known:
            known[name] = look
        elif material in at_root:
            edits.append((material, ""))
        elif known[name] != look:
            apart = f"{name}_line_{material.line}_{material.start}"
            edits.append((material, _tag(material, {"name": apart})))
    if not edits:
        return None
    for mesh in model.root.within():
        address = mesh.attributes.get("filename", "")
        if mesh.name == "mesh" and address and "://" not in address:
            path = str((model.file.parent / Path(address)).resolve())
            edits.append((mesh, _tag(mesh, {"filename": path})))
    content = model.content
    for element, text in sorted(edits, key=lambda edit: -edit[0].start):
        # as many line breaks as before, so that messages name the right line
        old = content[element.start : element.end]
        lost = old.count(b"\n") - text.count("\n")
        content = content[: element.start] + text.encode() + b"\n" * lost + content[element.end :]
    return content.decode("utf-8")


def _look(material: Element) -> tuple[tuple[str, ...], ...]:
    """Return what a material looks like: numbers of its colour, and its texture."""
    return tuple(
        (child.name, *(word for value in child.attributes.values() for word in value.split()))
        for child in material.children
    )


def _tag(element: Element, changed: dict[str, str]) -> str:
    """Return an element as text in one line, with changed attributes."""
    attributes = "".join(
        f" {name}={quoteattr(value)}" for name, value in (element.attributes | changed).items()
    )
    inside = "".join(_tag(child, {}) for child in element.children)
    return f"<{element.name}{attributes}>{inside}</{element.name}>"
