"""What contact is computed with: soft balls on a tool, rigid surfaces in the world."""

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
from pydrake.multibody.tree import Frame

from diagrams.scenario.workpiece import SoftBall


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
        plant: See :func:`add_soft_ball`.
        vertices: World axes [m], shape (k, 3).
        triangles: Counter-clockwise seen from outside of the material, shape (n, 3).
        name: Of the geometry.
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
