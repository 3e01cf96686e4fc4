"""Appearance of a robot: primitive shapes per body, as in ``appearance.yaml``.

The file is read by ``load_file(Appearance, path)`` of :mod:`pfsc_drake.yaml.typed`.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pfsc_drake.errors import InputError
from pfsc_drake.yaml.fields import REQUIRED

_DIGITS = 9  # of shape poses: the files do not depend on the last bits of a libm

_NEEDS = {
    "box": {"center": 3, "size": 3},
    "sphere": {"center": 3},
    "cylinder": {"start": 3, "end": 3},
    "capsule": {"start": 3, "end": 3},
}


def _empty() -> np.ndarray:
    return np.zeros(0)


@dataclass
class Shape:
    """One primitive, placed in the frame of the body (or axis) that it belongs to.

    Attributes:
        kind: ``box``, ``sphere``, ``cylinder`` or ``capsule``.
        material: a key of :attr:`Appearance.materials`.
        center: ``[3]`` of a box or sphere [m].
        size: ``[3]`` edge lengths of a box, parallel to the frame's axes [m].
        start: ``[3]`` centre of one end of a cylinder or capsule [m].
        end: ``[3]`` centre of the other end [m]; a capsule's caps reach beyond both.
        radius: of a sphere, cylinder or capsule [m].
    """

    kind: str = field(default="", metadata=REQUIRED)
    material: str = field(default="", metadata=REQUIRED)
    center: np.ndarray = field(default_factory=_empty)
    size: np.ndarray = field(default_factory=_empty)
    start: np.ndarray = field(default_factory=_empty)
    end: np.ndarray = field(default_factory=_empty)
    radius: float = 0.0

    def pose(self) -> list[float]:
        """Return ``[x, y, z, roll, pitch, yaw]`` of the primitive in its frame [m, rad]."""
        if self.kind in ("box", "sphere"):
            return [*self.center.tolist(), 0.0, 0.0, 0.0]
        x, y, z = (self.end - self.start).tolist()
        pitch, yaw = math.atan2(math.hypot(x, y), z), math.atan2(y, x)
        center = 0.5 * (self.start + self.end)
        return [round(value, _DIGITS) for value in (*center.tolist(), 0.0, pitch, yaw)]

    def geometry(self) -> ET.Element:
        """Return the SDF ``<geometry>`` element."""
        geometry = ET.Element("geometry")
        shape = ET.SubElement(geometry, self.kind)
        if self.kind == "box":
            ET.SubElement(shape, "size").text = format_numbers(self.size)
            return geometry
        ET.SubElement(shape, "radius").text = format_numbers([self.radius])
        if self.kind != "sphere":
            length = round(math.dist(self.start, self.end), _DIGITS)
            ET.SubElement(shape, "length").text = format_numbers([length])
        return geometry


@dataclass
class Appearance:
    """The look of a robot.

    Attributes:
        materials: colours ``[red, green, blue, opacity]``, each from 0 to 1, by name.
        elastic_axis_material: replaces the material of :attr:`axes` in models with elastic joints,
            to distinguish both kinds.
        bodies: shapes by name of the body, in the body's frame.
        axes: shapes around axis i in DH frame i - 1, where z is that axis. They turn with drive i.
    """

    materials: dict[str, np.ndarray] = field(default_factory=dict)
    elastic_axis_material: str = ""
    bodies: dict[str, list[Shape]] = field(default_factory=dict)
    axes: list[list[Shape]] = field(default_factory=list)

    def __post_init__(self) -> None:
        for name, color in self.materials.items():
            if color.shape != (4,) or not np.all((color >= 0) & (color <= 1)):
                shown = color.tolist()
                raise InputError(f"materials.{name} = {shown}: must be 4 numbers from 0 to 1")
        if self.elastic_axis_material:
            self._require_material("elastic_axis_material", self.elastic_axis_material)
        groups = {f"bodies.{name}": shapes for name, shapes in self.bodies.items()}
        groups |= {f"axes[{i}]": shapes for i, shapes in enumerate(self.axes)}
        for group, shapes in groups.items():
            for i, shape in enumerate(shapes):
                check_shape(f"{group}[{i}]", shape)
                self._require_material(f"{group}[{i}].material", shape.material)

    def _require_material(self, key: str, material: str) -> None:
        if material not in self.materials:
            raise InputError(f"{key} = {material!r}: must be one of {', '.join(self.materials)}")


def check_shape(where: str, shape: Shape) -> None:
    """Refuse a shape of unknown kind or invalid dimensions.

    Args:
        where: Key of the shape, for messages.
        shape: To check; its material is not.

    Raises:
        InputError: One line that names key, value and allowed values.
    """
    if shape.kind not in _NEEDS:
        raise InputError(f"{where}.kind = {shape.kind!r}: must be one of {', '.join(_NEEDS)}")
    for key, size in _NEEDS[shape.kind].items():
        value = getattr(shape, key)
        if value.shape != (size,) or not np.all(np.isfinite(value)):
            raise InputError(f"{where}.{key} = {value.tolist()}: must be {size} finite numbers")
    if shape.kind == "box":
        if not np.all(shape.size > 0):
            raise InputError(f"{where}.size = {shape.size.tolist()}: must be positive")
    elif not 0 < shape.radius < math.inf:
        raise InputError(f"{where}.radius = {shape.radius}: must be positive and finite")


def add_shapes(
    link: ET.Element,
    shapes: Sequence[Shape],
    appearance: Appearance,
    *,
    material: str = "",
    collisions: bool = False,
) -> None:
    """Append the shapes to an SDF ``<link>`` as visuals and, if requested, collision geometry.

    Args:
        link: the ``<link>`` element; its frame is the frame of the shapes.
        shapes: to append.
        appearance: contains the materials.
        material: replaces the shapes' own material, if not empty.
        collisions: whether the shapes are collision geometry, too.
    """
    for shape in shapes:
        number = len(link.findall("visual")) + 1
        color = appearance.materials[material or shape.material]
        for tag in ("visual", "collision") if collisions else ("visual",):
            element = ET.SubElement(link, tag, name=f"{tag}_{number}")
            ET.SubElement(element, "pose").text = format_numbers(shape.pose())
            element.append(shape.geometry())
            if tag == "visual":
                diffuse = ET.SubElement(ET.SubElement(element, "material"), "diffuse")
                diffuse.text = format_numbers(color)


def format_numbers(values: Sequence[float] | np.ndarray) -> str:
    """Return numbers in the shortest form that reads back exactly, separated by spaces."""
    return " ".join(repr(float(value) + 0.0).removesuffix(".0") for value in values)
