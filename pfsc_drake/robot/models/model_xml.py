"""Safe reading of a robot model's XML before Drake does.

The XML libraries used by Drake follow every include and report little about errors. Names keep
their prefixes (``drake:gear_ratio``), whether or not the file declares them: URDF files seldom do.
"""

import stat
import xml.parsers.expat as expat
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from pfsc_drake.errors import InputError

LARGEST_FILE = 20_000_000  # bytes; geometry belongs into files of its own
_DEEPEST = 200  # elements within elements
_MOST_ATTRIBUTES = 1000  # of one element; parsers compare each with all others
# elements for other simulators or drivers, in their own languages
_FOREIGN = frozenset({"gazebo", "plugin", "ros2_control"})


@dataclass
class Element:
    """An XML element.

    Attributes:
        name: Its tag, with prefix.
        attributes: Attributes by name, with prefix.
        line: Line of the file, from 1.
        start: Offset of its first byte.
        end: Offset behind its last byte.
        children: The elements in it.
        text: The text in it, without its children's text.
    """

    name: str
    attributes: dict[str, str]
    line: int
    start: int
    end: int = 0
    children: list["Element"] = field(default_factory=list)
    text: str = ""

    def all(self, *names: str) -> Iterator["Element"]:
        """Iterate over the elements at a path below this one, ``all("inertial", "mass")``."""
        for child in self.children:
            if child.name == names[0]:
                if len(names) == 1:
                    yield child
                else:
                    yield from child.all(*names[1:])

    def first(self, *names: str) -> "Element | None":
        """Return the first element at a path below this one, or None."""
        return next(self.all(*names), None)

    def within(self) -> Iterator["Element"]:
        """Iterate over this element and everything below it."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting += reversed(element.children)


@dataclass(frozen=True)
class ModelXml:
    """The XML of a model file.

    Attributes:
        file: The file.
        content: Its bytes.
        root: The outermost element.
    """

    file: Path
    content: bytes
    root: Element

    def location(self, element: Element) -> str:
        """Return ``file:line`` of an element."""
        return f"{self.file}:{element.line}"


def read_model_xml(file: Path) -> ModelXml:
    """Read a model file as XML.

    Args:
        file: A regular file of at most ``LARGEST_FILE`` bytes.

    Raises:
        InputError: If it is no such file, is not XML in UTF-8, declares entities, or needs xacro.
    """
    content = _read(file)
    model = ModelXml(file, content, _parse(file, content))
    _refuse_xacro(model)
    return model


def _read(file: Path) -> bytes:
    try:
        status = file.stat()
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{file}: cannot be read: allowed: a regular file")
        if status.st_size > LARGEST_FILE:
            raise InputError(
                f"{file}: cannot be read: {status.st_size} bytes; allowed: at most {LARGEST_FILE}"
            )
        content = file.read_bytes()
        content.decode("utf-8")
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or "not UTF-8 text"
        raise InputError(f"{file}: cannot be read: {reason}") from None
    return content


def _parse(file: Path, content: bytes) -> Element:
    """Return the outermost element; expat itself never opens another file."""
    parser = expat.ParserCreate("utf-8")
    parser.buffer_text = True
    open_elements = [Element("", {}, 0, 0)]

    def refuse_entity(name: str, *_: object) -> None:
        raise InputError(
            f"{file}:{parser.CurrentLineNumber}: cannot be read: declares the entity '{name}'; "
            "allowed: a model without entities of its own"
        )

    def start(name: str, attributes: dict[str, str]) -> None:
        if len(open_elements) > _DEEPEST:
            raise InputError(
                f"{file}:{parser.CurrentLineNumber}: cannot be read: more than {_DEEPEST} "
                "elements within each other"
            )
        if len(attributes) > _MOST_ATTRIBUTES:
            raise InputError(
                f"{file}:{parser.CurrentLineNumber}: cannot be read: {len(attributes)} attributes "
                f"of one element; allowed: up to {_MOST_ATTRIBUTES}"
            )
        element = Element(name, attributes, parser.CurrentLineNumber, parser.CurrentByteIndex)
        open_elements[-1].children.append(element)
        open_elements.append(element)

    def end(_: str) -> None:
        element, here = open_elements.pop(), parser.CurrentByteIndex
        # expat stands behind <a/>, but before the second tag of <a></a>
        empty = not (element.children or element.text)
        closed = empty and content[element.start : here].endswith(b"/>")
        element.end = here if closed else content.find(b">", here) + 1

    def text(data: str) -> None:
        open_elements[-1].text += data

    parser.EntityDeclHandler = refuse_entity
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = text
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        raise InputError(
            f"{file}: cannot be read: not XML in line {error.lineno}: {reason}"
        ) from None
    return open_elements[0].children[0]


def _refuse_xacro(model: ModelXml) -> None:
    waiting = [model.root]
    while waiting:
        element = waiting.pop()
        values = [element.text, *element.attributes.values()]
        if element.name.startswith("xacro:") or any("$(" in v or "${" in v for v in values):
            raise InputError(
                f"{model.location(element)}: <{element.name}> holds xacro that is not expanded: "
                "expand it first (xacro robot.urdf.xacro > robot.urdf)"
            )
        waiting += [child for child in element.children if child.name not in _FOREIGN]
