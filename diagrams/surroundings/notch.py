"""Ball and notch in a plant with contact."""

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    GeometryId,
    InMemoryMesh,
    Mesh,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, RigidBody, SpatialInertia, WeldJoint

from diagrams.scenario.notch import BallParameters, NotchParameters
from pfsc_drake.geometry import Path
from pfsc_drake.geometry.sweep import swept_surface

UP = np.array([0.0, 0.0, -1.0])  # z_0 points down
TOOL, SENSOR_JOINT, TOOL_POINT = "tool", "weld_tool", "tool_point"
_SPACING = 4e-3  # m, between cross-sections
_ARC_POINTS = 13


def add_ball(
    plant: MultibodyPlant, end_effector: RigidBody, mass: float, ball: BallParameters
) -> GeometryId:
    """Weld gripper and ball to the end-effector, with a joint for the sensor between.

    The frame ``tool_point`` on it is in E; the end-effector only translates, so that the
    inertia about the centre of mass has no effect.

    Args:
        plant: A plant that is registered with a scene graph and not finalized.
        end_effector: The end-effector.
        mass: Of everything behind the sensor [kg].
        ball: The ball.

    Returns:
        The ball's contact geometry.
    """
    half = RigidTransform(-0.5 * ball.distance * UP)
    inertia = SpatialInertia.SolidSphereWithMass(mass, ball.radius).Shift(-half.translation())
    tool = plant.AddRigidBody(TOOL, end_effector.model_instance(), inertia)
    plant.AddJoint(
        WeldJoint(SENSOR_JOINT, end_effector.body_frame(), tool.body_frame(), RigidTransform())
    )
    plant.AddFrame(FixedOffsetFrame(TOOL_POINT, tool.body_frame(), RigidTransform()))
    properties = ProximityProperties()
    AddContactMaterial(
        dissipation=ball.dissipation,
        friction=CoulombFriction(ball.friction, ball.friction),
        properties=properties,
    )
    AddCompliantHydroelasticProperties(
        resolution_hint=ball.resolution, hydroelastic_modulus=ball.modulus, properties=properties
    )
    X_TB = RigidTransform(-ball.distance * UP)
    return plant.RegisterCollisionGeometry(tool, X_TB, Sphere(ball.radius), "ball", properties)


def add_notch(plant: MultibodyPlant, path: Path, notch: NotchParameters) -> None:
    """Fix the workpiece to the world.

    Args:
        plant: A plant that is registered with a scene graph and not finalized.
        path: The path that was taught.
        notch: Workpiece and ball.
    """
    properties = ProximityProperties()
    friction = CoulombFriction(notch.ball.friction, notch.ball.friction)
    AddContactMaterial(friction=friction, properties=properties)
    AddRigidHydroelasticProperties(properties)
    obj = MemoryFile(_as_obj(*notch_surface(path, notch)), ".obj", "notch")
    plant.RegisterCollisionGeometry(
        plant.world_body(), RigidTransform(), Mesh(InMemoryMesh(mesh_file=obj)), "notch", properties
    )


def notch_surface(path: Path, notch: NotchParameters) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices [m], shape (k, 3), and triangles of the workpiece's surface.

    Args:
        path: The path that was taught.
        notch: Workpiece and ball.
    """
    begin, end = path.position.domain
    theta = np.linspace(begin, end, 2 + int(path.length / _SPACING))
    vertices, triangles = swept_surface(path.position, theta, _profile(notch), UP)
    # the path is that of E; the profile's origin is the notch's axis
    axis = np.array(notch.displacement) + (notch.clearance - notch.ball.distance) * UP
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


def _as_obj(vertices: np.ndarray, triangles: np.ndarray) -> str:
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in triangles + 1]
    return "\n".join(lines) + "\n"
