"""Loose plates with pins, the magazine that they lie on and the frame with bores for them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    Box,
    Capsule,
    Convex,
    GeometryId,
    ProximityProperties,
    SceneGraph,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import (
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
    MultibodyPlant,
)
from pydrake.multibody.tree import BodyIndex, SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from diagrams.scenario.plate import PlateContactParameters, PlateParameters
from pfsc_drake.geometry.workpieces import bore_wedges
from pfsc_drake.systems.plants.external_forces import PartnerForces

REST_RADIUS = 2e-3  # m, of the bosses on which a plate lies
PAD = 0.02, 0.01  # m, side and height of what they lie on


@dataclass(frozen=True)
class PlatePlant:
    """Plates, magazine and frame in a diagram.

    Attributes:
        plant: The plates, K free bodies; what they touch is fixed to its world.
        bodies: The plates in it.
        contact: Forces by frame and magazine on all plates, shape (6,) [N].
    """

    plant: MultibodyPlant
    bodies: list[BodyIndex]
    contact: PartnerForces


def add_plate_plant(
    builder: DiagramBuilder,
    parameters: PlateParameters,
    X_WM: RigidTransform,
    X_WF: RigidTransform,
    X_WPs: Sequence[RigidTransform],
    gravity: np.ndarray,
) -> PlatePlant:
    """Add a plant of its own for the plates.

    Args:
        builder: Builder of the diagram.
        parameters: The plates, the magazine and the frame.
        X_WM: Where a plate's frame is when it lies in the magazine.
        X_WF: Where it is when it is mounted.
        X_WPs: Where the K plates are at the start.
        gravity: World axes [m/s^2], shape (3,).
    """
    plant = builder.AddNamedSystem("plates", MultibodyPlant(parameters.contact.time_step))
    scene_graph = builder.AddNamedSystem("plate_scene", SceneGraph())
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)
    plant.set_contact_model(ContactModel.kPoint)
    plant.mutable_gravity_field().set_gravity_vector(gravity)
    bodies = [_add_plate(plant, parameters, f"plate_{i}") for i in range(len(X_WPs))]
    material = _material(parameters.contact)
    frame = _add_bores(plant, parameters, X_WF, material)
    frame += _add_pads(plant, parameters, X_WF, "frame", material)
    magazine = _add_pads(plant, parameters, X_WM, "magazine", material)
    plant.Finalize()
    for body, X_WP in zip(bodies, X_WPs, strict=True):
        plant.SetDefaultFloatingBaseBodyPose(plant.get_body(body), X_WP)
    builder.Connect(
        plant.get_geometry_pose_output_port(),
        scene_graph.get_source_pose_port(plant.get_source_id()),
    )
    builder.Connect(scene_graph.get_query_output_port(), plant.get_geometry_query_input_port())
    contact = builder.AddNamedSystem("plate_contact", PartnerForces([frame, magazine]))
    builder.Connect(
        plant.get_contact_results_output_port(), contact.GetInputPort("contact_results")
    )
    return PlatePlant(plant, bodies, contact)


def pin_shape(parameters: PlateParameters) -> tuple[Capsule, float]:
    """Return a pin as a capsule, and where its middle is along z of the plate [m].

    It is rooted within the plate by its radius, so that what protrudes is a cylinder with one
    round tip.
    """
    pins, thickness = parameters.pins, parameters.size[2]
    middle = thickness + (pins.length - pins.radius) / 2.0
    return Capsule(pins.radius, pins.length - pins.radius), middle


def _add_plate(plant: MultibodyPlant, parameters: PlateParameters, name: str) -> BodyIndex:
    length, width, thickness = parameters.size
    inertia = SpatialInertia.SolidBoxWithMass(parameters.mass, length, width, thickness)
    # the plate's frame is in the middle of its upper face
    plate = plant.AddRigidBody(name, inertia.Shift([0.0, 0.0, -thickness / 2.0]))
    material, (pin, middle) = _material(parameters.contact), pin_shape(parameters)
    for i, (x, y) in enumerate(parameters.pins.positions):
        X_PG = RigidTransform([x, y, middle])
        plant.RegisterCollisionGeometry(plate, X_PG, pin, f"{name}_pin_{i}", material)
    for i, (x, y) in enumerate(parameters.rests):
        X_PG = RigidTransform([x, y, thickness - REST_RADIUS])
        boss = Sphere(REST_RADIUS)
        plant.RegisterCollisionGeometry(plate, X_PG, boss, f"{name}_rest_{i}", material)
    return plate.index()


def _add_bores(
    plant: MultibodyPlant,
    parameters: PlateParameters,
    X_WF: RigidTransform,
    material: ProximityProperties,
) -> list[GeometryId]:
    frame, pins, added = parameters.frame, parameters.pins, []
    radius = pins.radius + frame.clearance / 2.0
    wedges = bore_wedges(radius, frame.ring, frame.depth, frame.wedges)
    for i, (x, y) in enumerate(pins.positions):
        X_WG = X_WF @ RigidTransform([x, y, parameters.size[2]])
        for j, corners in enumerate(wedges):
            name = f"bore_{i}_{j}"
            shape = Convex(points=corners.T, label=name)
            added.append(_fix(plant, X_WG, shape, name, material))
    return added


def _add_pads(
    plant: MultibodyPlant,
    parameters: PlateParameters,
    X_WC: RigidTransform,
    name: str,
    material: ProximityProperties,
) -> list[GeometryId]:
    side, height = PAD
    middle = parameters.size[2] + height / 2.0
    return [
        _fix(
            plant,
            X_WC @ RigidTransform([x, y, middle]),
            Box(side, side, height),
            f"{name}_pad_{i}",
            material,
        )
        for i, (x, y) in enumerate(parameters.rests)
    ]


def _fix(
    plant: MultibodyPlant,
    X_WG: RigidTransform,
    shape: Shape,
    name: str,
    material: ProximityProperties,
) -> GeometryId:
    return plant.RegisterCollisionGeometry(plant.world_body(), X_WG, shape, name, material)


def _material(contact: PlateContactParameters) -> ProximityProperties:
    material = ProximityProperties()
    AddContactMaterial(
        dissipation=contact.dissipation,
        # two in series make one of the contact's stiffness
        point_stiffness=2.0 * contact.stiffness,
        friction=CoulombFriction(contact.friction, contact.friction),
        properties=material,
    )
    return material
