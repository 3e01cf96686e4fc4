"""Drawing of a robot's model: meshes that can be drawn, and a stick figure where there is none."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path as FilePath
from xml.sax.saxutils import escape

import numpy as np
from pydrake.geometry import Box, Cylinder, Mesh, Rgba, Shape, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BodyIndex,
    Frame,
    Joint,
    JointIndex,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
)

from diagrams.drawing.mesh_geometry import NoMesh, geometry_of, in_memory
from pfsc_drake.errors import InputError, nearest_file
from pfsc_drake.geometry.files.mesh_files import read_stl
from pfsc_drake.robot.models.model_text import (
    Edit,
    distinct_materials,
    edited_text,
    with_attributes,
    without_textures,
)
from pfsc_drake.robot.models.model_xml import Element, read_model_xml
from pfsc_drake.systems.drawing.robot_visualizer import BodyPart, Triangles

_DRAWN = "obj, gltf, dae and stl"


def drawn_mesh(mesh: Mesh) -> Mesh | Triangles:
    """Return the drawing of a model's mesh: its geometry, or the triangles of an STL file.

    Args:
        mesh: The mesh as read by Drake, from a file.

    Raises:
        InputError: If its file cannot be drawn.
    """
    file = FilePath(mesh.source().path())
    with _explained(file):
        if file.suffix.lower() != ".stl":
            return in_memory(file, mesh)
        vertices, triangles = read_stl(file)
        return Triangles(vertices * mesh.scale3(), triangles)


def check_mesh_file(file: FilePath) -> None:
    """Refuse a file that cannot be drawn, or not in the browser.

    Args:
        file: The file.

    Raises:
        InputError: If it is missing, of another kind or not of the kind that its suffix names.
    """
    with _explained(file):
        if file.suffix.lower() != ".stl":  # its reader reports errors itself
            geometry_of(file)


@contextmanager
def _explained(file: FilePath) -> Iterator[None]:
    """Name the file of a mesh in errors while it is read.

    Raises:
        InputError: If it is missing, of another kind or not of the kind that its suffix names.
    """
    if not file.is_file():
        raise InputError(f"{file}: no such file{nearest_file(file)}")
    if file.suffix.lower() not in (".obj", ".gltf", ".dae", ".stl"):
        raise InputError(f"{file}: meshes of this kind are not drawn; drawn are {_DRAWN}")
    try:
        yield
    except OSError as error:
        raise InputError(f"{file}: {error.strerror}") from None
    except NoMesh:
        raise InputError(f"{file}: holds no mesh that could be drawn") from None


Resolve = Callable[[str], FilePath]


@dataclass(frozen=True)
class NotDrawn:
    """A link that cannot be drawn, at least in part.

    Attributes:
        link: Its name.
        reason: The reason, with the file's name.
    """

    link: str
    reason: str


def drawable_text(file: FilePath, resolve: Resolve) -> tuple[str, list[NotDrawn]]:
    """Return the text of a URDF or SDF file that Drake can draw.

    Collision geometry is removed, since it is not drawn and may be of kinds that only other parsers
    read. Visual meshes that cannot be drawn are removed, and so are textures. Mesh addresses become
    absolute. A material that is defined again with another content gets a name of its own.

    Args:
        file: The model.
        resolve: From the address of a mesh to its file; may raise InputError.

    Returns:
        The text, and the links that cannot be drawn.

    Raises:
        InputError: If the file cannot be read as a model.
    """
    model, missing = read_model_xml(file), list[NotDrawn]()
    edits = list(distinct_materials(model))
    every = list(model.root.within())
    edits += without_textures(model)
    edits += [(element, "") for element in every if element.name == "collision"]
    for link in (element for element in every if element.name == "link"):
        for visual in link.all("visual"):
            try:
                edits += [_located(mesh, resolve) for mesh in visual.all("geometry", "mesh")]
            except InputError as error:
                missing.append(NotDrawn(link.attributes.get("name", ""), str(error)))
                edits.append((visual, ""))
    return edited_text(model, edits), missing


def _located(mesh: Element, resolve: Resolve) -> Edit:
    """Return the edit that replaces a mesh's address by its file.

    Raises:
        InputError: If the file cannot be drawn.
    """
    uri = mesh.first("uri")  # SDF; URDF has an attribute
    written = mesh.attributes.get("filename", "") if uri is None else uri.text
    file = resolve(written.strip())
    check_mesh_file(file)
    address = f"file://{file.resolve()}"  # text has no folder for relative names
    if uri is None:
        return with_attributes(mesh, filename=address)
    return uri, f"<uri>{escape(address)}</uri>"


_STICK_COLOR = Rgba(0.55, 0.58, 0.62)
_JOINT_COLOR = Rgba(0.95, 0.55, 0.1)
_AXIS_COLORS = (Rgba(0.85, 0.1, 0.1), Rgba(0.1, 0.65, 0.2), Rgba(0.1, 0.25, 0.9))
# of the robot's length: radii of sticks and joints, and the axes of the tool's frame
_STICK, _JOINT, _AXIS = 0.012, 0.022, 0.08
_SMALLEST = 1e-6  # of the robot's length, below which two points are one


def stick_figure(plant: MultibodyPlant, tool: Frame) -> list[BodyPart]:
    """Return the parts of a stick figure.

    Every body is drawn by sticks from its inboard joint to its outboard joints, and to the tool
    frame if that is fixed to it; revolute joints as cylinders along their axes, prismatic ones as
    boxes, others as spheres; the tool frame as three axes (red x, green y, blue z). Thicknesses are
    in proportion to the robot's length.

    Args:
        plant: Plant with the robot, finalized.
        tool: The tool's frame.
    """
    joints = [plant.get_joint(JointIndex(i)) for i in plant.GetJointIndices()]
    bodies = [plant.get_body(BodyIndex(i)) for i in range(plant.num_bodies())]
    sticks = [stick for body in bodies for stick in _sticks(body, joints, tool)]
    length = sum(float(np.linalg.norm(end - begin)) for _, begin, end in sticks) or 1.0
    long = [stick for stick in sticks if np.linalg.norm(stick[2] - stick[1]) > _SMALLEST * length]
    parts = [
        _stick(body, f"stick_{i}", begin, end, _STICK * length, _STICK_COLOR)
        for i, (body, begin, end) in enumerate(long)
    ]
    parts += [_joint(joint, length) for joint in joints if joint.num_velocities() > 0]
    X_BT = tool.GetFixedPoseInBodyFrame()
    parts += [
        _stick(
            tool.body(),
            f"tool_axis_{i}",
            X_BT.translation(),
            X_BT @ (_AXIS * length * np.eye(3)[i]),
            0.3 * _STICK * length,
            color,
        )
        for i, color in enumerate(_AXIS_COLORS)
    ]
    return parts


def _sticks(
    body: RigidBody, joints: list[Joint], tool: Frame
) -> list[tuple[RigidBody, np.ndarray, np.ndarray]]:
    """Begin and end of each stick of a body, axes of the body [m]."""
    inboard = [joint for joint in joints if joint.child_body() is body]
    begin = _origin(inboard[0].frame_on_child()) if inboard else np.zeros(3)
    ends = [_origin(j.frame_on_parent()) for j in joints if j.parent_body() is body]
    if tool.body() is body:
        ends.append(_origin(tool))
    return [(body, begin, end) for end in ends]


def _origin(frame: Frame) -> np.ndarray:
    """Origin of a frame in its body's [m], shape (3,)."""
    return frame.GetFixedPoseInBodyFrame().translation()


def _stick(
    body: RigidBody, name: str, begin: np.ndarray, end: np.ndarray, radius: float, color: Rgba
) -> BodyPart:
    """A cylinder between two points of a body."""
    direction = end - begin
    R_BP = RotationMatrix.MakeFromOneVector(direction, 2)
    X_BP = RigidTransform(R_BP, (begin + end) / 2.0)
    return BodyPart(body, name, Cylinder(radius, float(np.linalg.norm(direction))), X_BP, color)


def _joint(joint: Joint, length: float) -> BodyPart:
    """A joint, drawn with its outboard body."""
    X_BF = joint.frame_on_child().GetFixedPoseInBodyFrame()
    size = _JOINT * length
    form: Shape = Sphere(size)
    axis = np.array([0.0, 0.0, 1.0])
    if isinstance(joint, RevoluteJoint):
        axis, form = joint.revolute_axis(), Cylinder(size, 3.0 * size)
    elif isinstance(joint, PrismaticJoint):
        axis, form = joint.translation_axis(), Box(1.6 * size, 1.6 * size, 3.0 * size)
    X_FP = RigidTransform(RotationMatrix.MakeFromOneVector(axis, 2))
    return BodyPart(joint.child_body(), f"joint_{joint.name()}", form, X_BF @ X_FP, _JOINT_COLOR)
