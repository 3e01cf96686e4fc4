"""Visual geometry of a robot: from its model, or a stick figure."""

import os
from dataclasses import dataclass, field
from pathlib import Path as FilePath

from pydrake.geometry import (
    GeometryId,
    Mesh,
    Rgba,
    Role,
    SceneGraph,
    SceneGraphInspector,
)
from pydrake.multibody.parsing import PackageMap, Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, RigidBody

from diagrams.drawing.model_meshes import NotDrawn, drawable_text, drawn_mesh, stick_figure
from diagrams.robots.model import locate_model
from diagrams.scenario import RobotParameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import packages_for
from pfsc_drake.robot.models.mjcf_meshes import is_converted
from pfsc_drake.robot.models.model_text import usable_text
from pfsc_drake.robot.models.model_xml import read_model_xml
from pfsc_drake.systems.drawing.robot_visualizer import BodyPart

# kinds of text that the parser reads, by the model's suffix; files of other kinds are not edited
_TEXTS = {".urdf": "urdf", ".sdf": "sdf"}
_NO_COLOR = Rgba(0.9, 0.9, 0.9, 1.0)


@dataclass(frozen=True)
class RobotDrawing:
    """Drawing of a robot.

    Attributes:
        plant: Plant with the bodies of the parts.
        parts: Parts to draw.
        warnings: Links that cannot be drawn, one sentence each.
        holder: Drawing of the workpiece robot, if there is one.
    """

    plant: MultibodyPlant
    parts: list[BodyPart]
    warnings: list[str] = field(default_factory=list)
    holder: "RobotDrawing | None" = None


def draw_robot(
    plant: MultibodyPlant, tool: Frame, parameters: RobotParameters, folder: FilePath
) -> RobotDrawing:
    """Return the drawing of a robot, with all parts of its model that can be drawn.

    Where a link cannot be drawn, and where there is no geometry, a stick figure is added.

    Args:
        plant: Plant of the simulated robot, finalized, without geometry.
        tool: The tool's frame.
        parameters: The robot.
        folder: Base folder of relative file names.
    """
    try:
        parts, missing = _visual_parts(plant, parameters, folder)
        warnings = _sentences(missing)
    except (InputError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        parts, warnings = [], [f"the model's geometry is not drawn: {reason}"]
    if warnings or not parts:
        parts = [*parts, *stick_figure(plant, tool)]
    return RobotDrawing(plant, parts, [f"{line}; sticks are drawn instead" for line in warnings])


def _sentences(missing: list[NotDrawn]) -> list[str]:
    """Return one line per reason, with all links that it concerns."""
    links: dict[str, list[str]] = {}
    for entry in missing:
        names = links.setdefault(entry.reason, [])
        if entry.link not in names:
            names.append(entry.link)
    return [f"not drawn of the robot: {', '.join(links[reason])}: {reason}" for reason in links]


def _visual_parts(
    plant: MultibodyPlant, parameters: RobotParameters, folder: FilePath
) -> tuple[list[BodyPart], list[NotDrawn]]:
    """Read a model's geometry, and return it as parts of the bodies of another plant.

    Raises:
        InputError: If the model cannot be read.
        RuntimeError: If Drake cannot read it.
    """
    # read by a plant of its own, so that the simulated one never depends on geometry
    shown, scene_graph = MultibodyPlant(time_step=0.0), SceneGraph()
    shown.RegisterAsSourceForSceneGraph(scene_graph)
    parser = Parser(shown)
    file = locate_model(parameters, folder)
    packages = packages_for(file, file.read_bytes(), parameters.options(folder).packages)
    parser.package_map().AddMap(packages)
    kind, missing = _TEXTS.get(file.suffix.lower()), list[NotDrawn]()
    if kind is None:
        usable = usable_text(read_model_xml(file))
        if usable is None:
            parser.AddModels(str(file))
        else:
            parser.AddModelsFromString(usable, file.suffix[1:].lower())
    else:
        text, missing = drawable_text(file, lambda address: _resolve(address, file, packages))
        parser.AddModelsFromString(text, kind)
    inspector = scene_graph.model_inspector()
    parts = []
    for geometry in inspector.GetAllGeometryIds(Role.kIllustration):
        body = shown.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        assert body is not None  # every frame of this source is one of the plant's bodies
        try:
            shape = inspector.GetShape(geometry)
            # also of files that are not edited
            if isinstance(shape, Mesh) and not is_converted(FilePath(shape.source().path())):
                _within(FilePath(shape.source().path()), file, packages)
            parts.append(_part(inspector, geometry, _same_body(plant, shown, body)))
        except InputError as error:
            missing.append(NotDrawn(body.name(), str(error)))
    return parts, missing


def _same_body(plant: MultibodyPlant, shown: MultibodyPlant, body: RigidBody) -> RigidBody:
    """Return the body of the same name in another plant of the same model.

    Raises:
        InputError: If there is none.
    """
    model = shown.GetModelInstanceName(body.model_instance())
    if plant.HasModelInstanceNamed(model):
        instance = plant.GetModelInstanceByName(model)
        if plant.HasBodyNamed(body.name(), instance):
            return plant.GetBodyByName(body.name(), instance)
    raise InputError("the simulated robot has no such link")


def _part(inspector: SceneGraphInspector, geometry: GeometryId, body: RigidBody) -> BodyPart:
    shape = inspector.GetShape(geometry)
    form = drawn_mesh(shape) if isinstance(shape, Mesh) else shape
    properties = inspector.GetProperties(geometry, Role.kIllustration)
    color = properties.GetPropertyOrDefault("phong", "diffuse", _NO_COLOR)
    name = f"{inspector.GetName(geometry).split('::')[-1]}_{geometry.get_value()}"
    return BodyPart(body, name, form, inspector.GetPoseInFrame(geometry), color)


def _resolve(address: str, file: FilePath, packages: PackageMap) -> FilePath:
    """Return the file of a mesh address in a model.

    Raises:
        InputError: If its package is not known, or it is outside the model's packages.
    """
    for scheme in ("package://", "model://"):
        if address.startswith(scheme):
            package, _, rest = address.removeprefix(scheme).partition("/")
            if not packages.Contains(package):
                raise InputError(
                    f"the package '{package}' is not known, no package.xml above the model "
                    f"names it: write robot.packages: {{{package}: FOLDER}}"
                )
            return _within(FilePath(packages.GetPath(package)) / rest, file, packages)
    return _within(file.parent / address.removeprefix("file://"), file, packages)


def _within(mesh: FilePath, file: FilePath, packages: PackageMap) -> FilePath:
    """Return a mesh of a model's packages, or of the folder above the model's or below.

    Raises:
        InputError: If it is elsewhere.
    """
    path = FilePath(os.path.normpath(mesh.absolute()))
    # packages known to Drake may have to be downloaded first
    names = set(packages.GetPackageNames()) - set(PackageMap().GetPackageNames())
    folders = [packages.GetPath(name) for name in names]
    for folder in (file.absolute().parent.parent, *folders):
        if FilePath(os.path.normpath(folder)) in path.parents:
            return path
    raise InputError(
        f"{mesh}: outside the model's packages: write robot.packages: {{NAME: FOLDER}}, and "
        "package://NAME/.. in the model"
    )
