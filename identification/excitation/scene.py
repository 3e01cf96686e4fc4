"""A serial robot and its cell in Drake's geometry engine: exact distances along a motion.

Collision geometry comes from the model; links without it use their visual shapes. Meshes are
replaced by their convex hulls.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
from pydrake.geometry import (
    Box,
    Capsule,
    Cylinder,
    GeometryId,
    GeometryInstance,
    ProximityProperties,
    Role,
    SceneGraphInspector,
    Sphere,
)
from pydrake.geometry import Shape as DrakeShape
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from diagrams.robots.model import locate_model
from identification.model.subject import Subject, tool_frame_of
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import models_directory
from pfsc_drake.robot.models.reading import read_model
from pfsc_drake.robot.models.visuals import Shape, check_shape
from pfsc_drake.robot.serial.chain_from_plant import chain_from_plant
from pfsc_drake.robot.serial.link_points import link_frames
from pfsc_drake.yaml.fields import REQUIRED
from pfsc_drake.yaml.rules import Count, NotNegative, Parameters
from pfsc_drake.yaml.typed import load_file


@dataclass
class Obstacle(Shape):
    """A static primitive in the world frame; see :class:`Shape`.

    Attributes:
        name: Name for messages.
        beside: Links of the model that are next to it by design and not checked against it.
    """

    material: str = ""
    name: str = field(default="obstacle", metadata=REQUIRED)
    beside: list[str] = field(default_factory=list)


@dataclass
class Cell(Parameters):
    """Environment of a robot, with required clearances.

    Attributes:
        obstacles: Obstacles.
        tool_above: Least z of the end effector in the world [m], of the flange without a tool;
            minus infinity for any.
        clearance: Least distance between the robot and obstacles, and between links that are not
            neighbours [m].
        self_collision: Whether links that are not neighbours are checked against each other.
        joined: Pairs of links that are not checked, because joint limits keep them apart.
    """

    obstacles: list[Obstacle] = field(default_factory=list)
    tool_above: float = -np.inf
    clearance: NotNegative = 0.02
    self_collision: bool = True
    joined: list[Annotated[list[str], Count(2, 2, words="pairs of names of links")]] = field(
        default_factory=list
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for i, obstacle in enumerate(self.obstacles):
            check_shape(f"obstacles[{i}]", obstacle)
        if np.isnan(self.tool_above) or self.tool_above == np.inf:
            raise InputError(f"tool_above = {self.tool_above}; must be a number [m]")


WORLD = -1  # link of static bodies
# shapes that are near in each of so many postures are so by design
_POSTURES = 100
_FULL_TURN = np.pi  # of joints without limits


@dataclass(frozen=True)
class PlacedShape:
    """A shape of the robot.

    Attributes:
        geometry: Identifier.
        link: Index of its link in the chain, from 0; ``WORLD`` for the base.
        body: Name of its body.
        X_LG: Pose in the chain's link frame, in the world for the base.
    """

    geometry: GeometryId
    link: int
    body: str
    X_LG: RigidTransform


@dataclass(frozen=True)
class Pair:
    """Two shapes that must not touch.

    Attributes:
        first: A shape of the robot.
        second: Another one, or an obstacle.
        name: Names of both, for messages.
    """

    first: GeometryId
    second: GeometryId
    name: str


class RobotScene:
    """A serial robot and its cell.

    Args:
        subject: The robot; read from its model once more, with geometry.
        cell: Environment of the robot.

    Attributes:
        shapes: Shapes of the robot.
        obstacles: Obstacles of the cell, with their identifiers.
        pairs: Pairs that must not touch.
        warnings: Omitted checks, one sentence each.

    Raises:
        InputError: If ``beside`` of an obstacle names no link, or the robot is not a serial one.
    """

    def __init__(self, subject: Subject, cell: Cell) -> None:
        if subject.chain is None or subject.block is None:
            raise InputError(f"{subject.name}: collisions are checked of serial robots only")
        builder = DiagramBuilder()
        self._plant, self._scene = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
        file = locate_model(subject.block, subject.folder)
        read_model(self._plant, file, subject.block.options(subject.folder))
        tool = tool_frame_of(self._plant, subject.block)
        chain, self._coordinates = chain_from_plant(self._plant, tool)
        self._dimension = chain.dimension
        self.obstacles = [(obstacle, self._add(obstacle)) for obstacle in cell.obstacles]
        self.shapes = self._find_shapes(subject)
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()
        self.warnings: list[str] = []
        if not any(shape.link != WORLD for shape in self.shapes):
            self.warnings.append(
                f"{subject.name}: the model has no shapes; collisions are not checked"
            )
        self.pairs = self._pairs(cell)
        self._drop_joined(subject.position_limits, cell.clearance)

    @property
    def inspector(self) -> SceneGraphInspector:
        """Inspector of the scene graph's shapes."""
        return self._scene.model_inspector()

    def distances(self, q: np.ndarray, numbers: np.ndarray | None = None) -> np.ndarray:
        """Return the distances of pairs [m], shape (K, n).

        Args:
            q: Joint positions [rad or m], shape (K, N).
            numbers: Numbers of the pairs, n of them; all by default.
        """
        plant_context = self._plant.GetMyMutableContextFromRoot(self._context)
        scene_context = self._scene.GetMyMutableContextFromRoot(self._context)
        port = self._scene.get_query_output_port()
        chosen = self.pairs if numbers is None else [self.pairs[i] for i in numbers]
        pairs = [(pair.first, pair.second) for pair in chosen]
        table = np.empty((len(q), len(pairs)))
        still = np.zeros(self._dimension)
        for row, positions in zip(table, q, strict=True):
            state = self._coordinates.plant_state(np.concatenate([positions, still] * 2))
            self._plant.SetPositions(plant_context, state[: self._plant.num_positions()])
            query = port.Eval(scene_context)
            row[:] = [query.ComputeSignedDistancePairClosestPoints(a, b).distance for a, b in pairs]
        return table

    def _add(self, obstacle: Obstacle) -> GeometryId:
        source, frame = self._plant.get_source_id(), self._scene.world_frame_id()
        pose, shape = obstacle_shape(obstacle)
        instance = GeometryInstance(pose, shape, f"cell_{obstacle.name}")
        instance.set_proximity_properties(ProximityProperties())
        return self._scene.RegisterGeometry(source, frame, instance)

    def _find_shapes(self, subject: Subject) -> list[PlacedShape]:
        """Collect the shapes of the chain's links and assign proximity roles to visual ones."""
        plant, inspector = self._plant, self.inspector
        plain = plant.CreateDefaultContext()
        groups = [(WORLD, plant.world_frame())]
        groups += list(enumerate(link_frames(plant, self._coordinates)))
        left_out = removed_tool_name(subject)
        found = []
        for link, frame in groups:
            by_role: dict[Role, list[PlacedShape]] = {Role.kProximity: [], Role.kIllustration: []}
            for body in plant.GetBodiesWeldedTo(frame.body()):
                if body.name() == left_out:
                    continue
                frame_id = plant.GetBodyFrameIdOrThrow(body.index())
                X_LB = plant.CalcRelativeTransform(plain, frame, body.body_frame())
                for role, shapes in by_role.items():
                    for g in inspector.GetGeometries(frame_id, role):
                        if inspector.GetName(g).startswith("cell_"):
                            continue
                        X_LG = X_LB @ inspector.GetPoseInFrame(g)
                        shapes.append(PlacedShape(g, link, body.name(), X_LG))
            shapes = by_role[Role.kProximity]
            if not shapes:
                shapes = by_role[Role.kIllustration]
                for shape in shapes:
                    self._scene.AssignRole(
                        plant.get_source_id(), shape.geometry, ProximityProperties()
                    )
            found += shapes
        return found

    def _pairs(self, cell: Cell) -> list[Pair]:
        self._require_bodies([name for pair in cell.joined for name in pair], "joined")
        joined = [set(pair) for pair in cell.joined]
        pairs: list[Pair] = []
        for obstacle, identifier in self.obstacles:
            self._require_bodies(obstacle.beside, f"obstacle '{obstacle.name}': beside")
            pairs += [
                Pair(shape.geometry, identifier, f"{shape.body} and {obstacle.name}")
                for shape in self.shapes
                if shape.link != WORLD and shape.body not in obstacle.beside
            ]
        if cell.self_collision:
            pairs += [
                Pair(a.geometry, b.geometry, f"{a.body} and {b.body}")
                for a in self.shapes
                for b in self.shapes
                if b.link - a.link > 1 and {a.body, b.body} not in joined
            ]
        return pairs

    def _require_bodies(self, names: list[str], key: str) -> None:
        for name in names:
            if not self._plant.HasBodyNamed(name):
                known = ", ".join(sorted({shape.body for shape in self.shapes}))
                raise InputError(f"cell: {key} = '{name}'; must be one of {known}")

    def _drop_joined(self, position_limits: np.ndarray, clearance: float) -> None:
        """Remove pairs that are too near in all of some random postures."""
        if not self.pairs:
            return
        lower, upper = np.clip(position_limits, -_FULL_TURN, _FULL_TURN).T
        q = np.random.default_rng(0).uniform(lower, upper, (_POSTURES, self._dimension))
        touching = np.all(self.distances(q) < clearance, axis=0)
        self.pairs = [p for p, joined in zip(self.pairs, touching, strict=True) if not joined]


def cell_of(subject: Subject, cell: Cell | str | Path | None) -> Cell:
    """Return the cell of a robot.

    Args:
        subject: The robot.
        cell: A cell, or its file; None for the one shipped with the robot's model, or an empty one.

    Raises:
        InputError: If the file cannot be read or does not fit; one line that names it.
    """
    if isinstance(cell, Cell):
        return cell
    if cell is not None:
        return load_file(Cell, cell)
    model = subject.name if subject.block is None else subject.block.model
    shipped = models_directory() / Path(model).stem / "cell.yaml"
    return load_file(Cell, shipped) if shipped.is_file() else Cell()


def obstacle_shape(obstacle: Obstacle) -> tuple[RigidTransform, DrakeShape]:
    """Return pose in the world and shape of an obstacle, for Drake."""
    x, y, z, roll, pitch, yaw = obstacle.pose()
    pose = RigidTransform(RollPitchYaw(roll, pitch, yaw), [x, y, z])
    if obstacle.kind == "box":
        return pose, Box(*obstacle.size)
    if obstacle.kind == "sphere":
        return pose, Sphere(obstacle.radius)
    length = float(np.linalg.norm(obstacle.end - obstacle.start))
    kind = Capsule if obstacle.kind == "capsule" else Cylinder
    return pose, kind(obstacle.radius, length)


def removed_tool_name(subject: Subject) -> str:
    """Return the name of the tool's body that the subject excludes."""
    if subject.tool or subject.parameters is None:
        return ""
    return subject.parameters.tool.name
