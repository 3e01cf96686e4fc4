"""Workpieces that a tool touches: a notch in which a ball runs, a surface under pressure."""

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Cylinder,
    GeometryId,
    InMemoryMesh,
    Mesh,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import Frame

from diagrams.robots.workpiece import FurtherLength, Workpiece, WorkpieceDrawing, upwards
from diagrams.scenario.workpiece import NotchParameters, SoftBall, WorkpieceParameters
from pfsc_drake.control.manifolds.surface import SurfaceManifold
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import Path, PathPointLayout, zyx_to_matrix
from pfsc_drake.geometry.surfaces.curvature import surface_axes
from pfsc_drake.geometry.surfaces.parametric_surface import Surface
from pfsc_drake.geometry.surfaces.surface_evaluator import SurfaceEvaluator
from pfsc_drake.geometry.workpiece_bodies import surface_mesh, swept_surface
from pfsc_drake.robot.delta.shapes import ACCENT, METAL
from pfsc_drake.systems.drawing.robot_visualizer import Triangles
from pfsc_drake.systems.drawing.tool_visualizer import ToolPart

_SPACING = 4e-3  # m, between cross-sections
_ARC_POINTS = 13
_HOLDER_RADIUS = 0.008  # m


class NotchedWorkpiece(Workpiece):
    """A rigid workpiece with a notch along a path, and a ball with a soft shell on the tool.

    Args:
        path: The taught path.
        parameters: Workpiece and ball.
    """

    def __init__(self, path: Path, parameters: NotchParameters) -> None:
        self._path, self.parameters = path, parameters

    @property
    def time_step(self) -> float:
        """Step of the plant with contact [s]."""
        return self.parameters.time_step

    @property
    def reach(self) -> float:
        """Distance of the touching part from the tool point [m]."""
        return self.parameters.ball.distance

    @property
    def radius(self) -> float:
        """Its size [m]."""
        return self.parameters.ball.radius

    def add(self, plant: MultibodyPlant, tool: Frame) -> list[GeometryId]:
        """Fix the workpiece to the world, and the part that touches it to the tool.

        A tool with a ball below it has the axes of the world.
        """
        ball, up = self.parameters.ball, upwards(plant.gravity_field().gravity_vector(), "notch")
        add_rigid_surface(
            plant, *notch_surface(self._path, self.parameters, up), "notch", ball.friction
        )
        return [add_soft_ball(plant, tool, ball, -ball.distance * up)]

    def start_shift(self, gravity: np.ndarray) -> np.ndarray:
        """Return the displacement to the middle of the notch, where the ball touches nothing."""
        up = upwards(gravity, "notch")
        return np.array(self.parameters.displacement) + self.parameters.clearance * up

    def check_start(self, y_t: np.ndarray) -> None:
        """Accept every start; :meth:`start_shift` moves the ball out of the workpiece."""

    def lengths(
        self, y_t: np.ndarray, initial_projection: np.ndarray, gravity: np.ndarray
    ) -> dict[str, FurtherLength]:
        """Return ``notch_position`` of the ball, see :func:`position_in_notch`."""
        up = upwards(gravity, "notch")
        position = position_in_notch(self._path, self.parameters, y_t, initial_projection[0], up)
        limit = self.parameters.clearance
        return {"notch_position": FurtherLength(position, ["left", "above"], limit)}

    def drawing(self, gravity: np.ndarray) -> WorkpieceDrawing:
        """Return workpiece and ball, and the rod of a ball that is away from the tool point."""
        ball, up = self.parameters.ball, upwards(gravity, "notch")
        parts = [ToolPart("ball", Sphere(ball.radius), ACCENT, RigidTransform(-ball.distance * up))]
        length = ball.distance - ball.radius
        if length > 0.0:
            along = RotationMatrix.MakeFromOneVector(up, 2)
            X_TH = RigidTransform(along, -0.5 * length * up)
            parts.append(ToolPart("holder", Cylinder(_HOLDER_RADIUS, length), METAL, X_TH))
        return WorkpieceDrawing(Triangles(*notch_surface(self._path, self.parameters, up)), parts)


def position_in_notch(
    path: Path, notch: NotchParameters, y_t: np.ndarray, initial_theta: float, up: np.ndarray
) -> np.ndarray:
    """Return the position of the ball's centre in the cross-section of its notch.

    It touches the round bottom at a distance ``notch.clearance`` from the notch's axis.

    Args:
        path: The taught path.
        notch: Ball and workpiece.
        y_t: Motion of the tool point [m], shape (samples, 3).
        initial_theta: Path parameter near the first sample.
        up: Unit vector in the world, shape (3,).

    Returns:
        Distances to the left of the notch's axis, looking along the path, and above it [m], shape
        (samples, 2).
    """
    evaluator = path.evaluator(2)
    layout = PathPointLayout(2, path.orientation is not None)
    # relative to the taught pose of the workpiece, and from the bottom up to the axis
    moved = y_t - np.array(notch.displacement) - notch.clearance * up
    position, theta = np.full((len(y_t), 2), np.nan), initial_theta
    for k, y in enumerate(moved):
        if not np.isfinite(y).all():
            continue
        point = evaluator(y.tolist(), theta)
        theta = point[layout.theta][0]
        sigma, slope = point[layout.position].reshape(-1, 3)[:2]
        left = np.cross(up, slope)
        left /= np.linalg.norm(left)
        above = np.cross(slope / np.linalg.norm(slope), left)
        position[k] = left @ (y - sigma), above @ (y - sigma)
    return position


def notch_surface(
    path: Path, notch: NotchParameters, up: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices [m], shape (k, 3), and triangles of the workpiece's surface.

    Args:
        path: The taught path.
        notch: Workpiece and ball.
        up: Unit vector in the world, shape (3,).
    """
    begin, end = path.position.domain
    theta = np.linspace(begin, end, 2 + int(path.length / _SPACING))
    vertices, triangles = swept_surface(path.position, theta, _profile(notch), up)
    # the path is the path of E; the profile's origin is the notch's axis
    axis = np.array(notch.displacement) + (notch.clearance - notch.ball.distance) * up
    return vertices + axis, triangles


def _profile(notch: NotchParameters) -> np.ndarray:
    """Return the cross-section left to right about the notch's axis, rim walls upright."""
    angle = np.linspace(0.0, np.pi, _ARC_POINTS)
    arc = notch.radius * np.column_stack([np.cos(angle), -np.sin(angle)])
    rim, edge = notch.depth - notch.radius, 0.5 * notch.width
    left = [[edge, rim], [notch.radius, rim]]
    right = [[-notch.radius, rim], [-edge, rim]]
    if rim == 0.0:  # the rim ends where the arc begins
        left, right = left[:1], right[1:]
    return np.vstack([left, arc, right])


class PressedWorkpiece(Workpiece):
    """A rigid workpiece that has moved since its surface was taught.

    Args:
        surface: The taught surface; its normal points out of the material.
        manifold: Manifold of the surface, with the orientation of the tool normal to it.
        parameters: Workpiece and ball.

    Raises:
        InputError: If the tool's orientation is not normal to the surface.
    """

    def __init__(
        self, surface: Surface, manifold: SurfaceManifold, parameters: WorkpieceParameters
    ) -> None:
        if manifold.offset is None:
            raise InputError(
                "surface.orientation.kind: must be normal where there is a workpiece; the ball is "
                "behind the tool point along the normal"
            )
        self._surface, self.parameters = surface, parameters
        self._p_TC = parameters.ball.radius * manifold.offset[2]
        self._R = zyx_to_matrix(np.deg2rad(parameters.turn_zyx_deg))
        self._middle = surface.partials([sum(ends) / 2.0 for ends in surface.domain], 0)[0]
        self._evaluator = SurfaceEvaluator(surface, 1)

    @property
    def time_step(self) -> float:
        """Step of the plant with contact [s]."""
        return self.parameters.time_step

    @property
    def reach(self) -> float:
        """Distance of the touching part from the tool point [m]."""
        return 0.0

    @property
    def radius(self) -> float:
        """Its size [m]."""
        return self.parameters.ball.radius

    def add(self, plant: MultibodyPlant, tool: Frame) -> list[GeometryId]:
        """Fix the workpiece to the world, and the part that touches it to the tool."""
        ball = self.parameters.ball
        add_rigid_surface(plant, *self.mesh(), "workpiece", ball.friction)
        return [add_soft_ball(plant, tool, ball, self._p_TC)]

    def mesh(self) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices [m] and triangles of the workpiece in its actual pose, world axes."""
        vertices, triangles = surface_mesh(self._surface, self.parameters.spacing)
        moved = (vertices - self._middle) @ self._R.T + self._middle + self.parameters.shift
        return moved, triangles

    def touch(
        self, y_t: np.ndarray, near: np.ndarray | None = None
    ) -> tuple[float, np.ndarray, np.ndarray]:
        """Return height over the workpiece [m], its normal, and the closest point's parameters.

        Args:
            y_t: Tool point [m], shape (3,).
            near: Parameters near the closest point, shape (2,); by default the whole surface is
                searched.
        """
        taught = (y_t - self.parameters.shift - self._middle) @ self._R + self._middle
        if near is None:
            theta = np.array(self._evaluator.project_globally(taught).theta)
            sigma, first, second = self._surface.partials(self._surface.wrap(theta), 1)
        else:
            point = self._evaluator(taught.tolist(), near.tolist(), (0.0, 0.0))
            theta = point[:2]
            rows = point[self._evaluator.layout.position].reshape(-1, 3)
            sigma, first, second = rows[:3]
        normal = surface_axes(first, second)[:, 2]
        return float(normal @ (taught - sigma)), self._R @ normal, theta

    def stiffness(self, force: float) -> float:
        """Return the stiffness of the contact along the normal under a force [N/m].

        See :meth:`SoftBall.stiffness <diagrams.scenario.workpiece.SoftBall.stiffness>`; the
        workpiece is rigid, and flat at the contact.

        Args:
            force: Normal force [N].
        """
        return self.parameters.ball.stiffness(force)

    def check_start(self, y_t: np.ndarray) -> None:
        """Refuse a start inside of the workpiece; the ball reaches to the tool point."""
        height, _, _ = self.touch(y_t)
        if height < 0.0:
            raise InputError(
                f"start: the tool point is {-1e3 * height:.3g} mm inside of the workpiece; "
                "start.offset[0] must be larger, along the normal"
            )

    def start_shift(self, gravity: np.ndarray) -> np.ndarray:
        """Return zero: the scenario specifies the distance from the surface at the start."""
        del gravity
        return np.zeros(3)

    def lengths(
        self, y_t: np.ndarray, initial_projection: np.ndarray, gravity: np.ndarray
    ) -> dict[str, FurtherLength]:
        """Return none: distances from the surface are coordinates of the task."""
        del y_t, initial_projection, gravity
        return {}

    def drawing(self, gravity: np.ndarray) -> WorkpieceDrawing:
        """Return the drawing of workpiece and ball."""
        del gravity
        ball = ToolPart(
            "ball", Sphere(self.parameters.ball.radius), ACCENT, RigidTransform(self._p_TC)
        )
        return WorkpieceDrawing(Triangles(*self.mesh()), [ball])

    def normal(self, axes: np.ndarray) -> np.ndarray:
        """Return the surface's normal, turned with the workpiece, shape (3,)."""
        return np.asarray(self._R @ axes[:, 2])


def add_soft_ball(
    plant: MultibodyPlant, tool: Frame, ball: SoftBall, p_TC: np.ndarray
) -> GeometryId:
    """Add a ball to a tool.

    Args:
        plant: A plant that is registered with a scene graph and not finalized.
        tool: Frame at the tool point.
        ball: The ball.
        p_TC: Its centre in the tool's frame [m], shape (3,).
    """
    properties = ProximityProperties()
    AddContactMaterial(
        dissipation=ball.dissipation,
        friction=CoulombFriction(ball.friction, ball.friction),
        properties=properties,
    )
    AddCompliantHydroelasticProperties(
        resolution_hint=ball.resolution,
        hydroelastic_modulus=ball.modulus,
        properties=properties,
    )
    X_BC = tool.GetFixedPoseInBodyFrame() @ RigidTransform(p_TC)
    return plant.RegisterCollisionGeometry(
        tool.body(), X_BC, Sphere(ball.radius), "ball", properties
    )


def add_rigid_surface(
    plant: MultibodyPlant,
    vertices: np.ndarray,
    triangles: np.ndarray,
    name: str,
    friction: float,
) -> None:
    """Fix a rigid surface to the world.

    Args:
        plant: Plant to add it to, not finalized.
        vertices: Vertices in world axes [m], shape (k, 3).
        triangles: Vertex indices, counter-clockwise from outside of the material, shape (n, 3).
        name: Name of the geometry.
        friction: Coulomb coefficient.
    """
    properties = ProximityProperties()
    AddContactMaterial(friction=CoulombFriction(friction, friction), properties=properties)
    AddRigidHydroelasticProperties(properties)
    file = MemoryFile(_as_obj(vertices, triangles), ".obj", name)
    mesh = Mesh(InMemoryMesh(mesh_file=file))
    plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform(), mesh, name, properties)


def _as_obj(vertices: np.ndarray, triangles: np.ndarray) -> str:
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in triangles + 1]
    return "\n".join(lines) + "\n"
