"""Mounting plates: poses of magazine and frame, and a plant of plates, bores and rests."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import (
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
    MultibodyPlant,
)
from pydrake.multibody.tree import BodyIndex, SpatialInertia
from pydrake.systems.framework import DiagramBuilder
from scipy.spatial.transform import Rotation

from diagrams.scenario.plate import CarrierParameters, PlateContactParameters, PlateParameters
from pfsc_drake.checks import require, require_whole_fraction
from pfsc_drake.controller.tasks.path_task import PathTask
from pfsc_drake.controller.tasks.task import StartPoint, Task
from pfsc_drake.errors import InputError
from pfsc_drake.geometry import quaternion_to_matrix
from pfsc_drake.geometry.workpiece_bodies import bore_wedges
from pfsc_drake.systems.plants.applied_wrenches import PartnerForces

_ORIENTED = 6  # coordinates of a path with all of its orientation


@dataclass(frozen=True)
class Mounting:
    """Poses of the plates in magazine and frame.

    Attributes:
        parameters: Plates, pins, magazine, frame and gripper.
        X_WM: Pose of a plate in the magazine.
        X_WF: Pose of a plate that is mounted.
    """

    parameters: PlateParameters
    X_WM: RigidTransform
    X_WF: RigidTransform

    def start(self, start: StartPoint, task: Task) -> StartPoint:
        """Return the start of the tool; with ``plate.start: frame`` that is the mounted pose.

        Args:
            start: Start of the task.
            task: The task.

        Raises:
            InputError: If cups or pins penetrate plate or frame at the start.
        """
        if self.parameters.start == "frame":
            shift = self.X_WF.translation() - start.target.y_t
            start = task.start(shift)
            R_e = self.X_WF.rotation().matrix()
            return replace(start, target=replace(start.target, R_e=R_e))
        check = self._check_pins if self.parameters.start == "held" else self._check_cups
        check(tool_transform(start))
        return start

    def plates(self, start: StartPoint) -> list[RigidTransform]:
        """Return the poses of the plates at the start, the gripped plate first.

        Args:
            start: Start of the tool.
        """
        return {
            "magazine": [self.X_WM],
            "held": [tool_transform(start)],
            "frame": [self.X_WF, self.X_WM],
        }[self.parameters.start]

    def _check_cups(self, X_WT: RigidTransform) -> None:
        """Refuse a start with a cup in the plate in the magazine."""
        x_y = np.array(self.parameters.suction.cups)
        rims = np.column_stack([x_y, np.zeros(len(x_y))])
        depth = float((self.X_WM.inverse() @ X_WT).multiply(rims.T)[2].max())
        if depth > 0.0:
            raise InputError(
                f"plate.magazine: a cup starts {1e3 * depth:.3g} mm inside of the plate in the "
                "magazine; the tool must start farther away (reference.points), or the magazine "
                "be moved less"
            )

    def _check_pins(self, X_WT: RigidTransform) -> None:
        """Refuse a start with a pin in the frame."""
        pins, frame = self.parameters.pins, self.parameters.frame
        below = self.parameters.size[2] + pins.length
        axes = np.array(pins.positions)
        tips = np.column_stack([axes, np.full(len(axes), below)])
        tips_F = (self.X_WF.inverse() @ X_WT).multiply(tips.T).T
        depth = tips_F[:, 2] - self.parameters.size[2]
        beside = np.linalg.norm(tips_F[:, :2] - axes, axis=1)
        overlaps = (depth > 0.0) & (beside > frame.clearance / 2.0)
        if overlaps.any():
            i = int(np.argmax(overlaps))
            raise InputError(
                f"plate.frame: pin {i} of the plate that is held starts {1e3 * depth[i]:.3g} mm "
                f"deep in the frame, {1e3 * beside[i]:.3g} mm from its bore's axis; the tool must "
                "start farther away (reference.points), or the frame be moved less"
            )


def make_mounting(plate: PlateParameters, task: Task, *, has_hand: bool, period: float) -> Mounting:
    """Return the poses of the plates in magazine and frame.

    Args:
        plate: The plates.
        task: Task of the tool.
        has_hand: Whether there is an operator's hand.
        period: Sampling time [s].

    Raises:
        InputError: If the plates do not suit the task.
    """
    require_whole_fraction("plate.contact.time_step", plate.contact.time_step, period)
    if not isinstance(task, PathTask) or len(task.projected_manifold.coordinates) != _ORIENTED:
        raise InputError("plate = given: allowed: null unless a path with orientation is followed")
    operated = plate.operator is not None
    require(not operated or has_hand, "hand", "null", "given for plate.operator")
    returns = plate.operator is not None and plate.operator.task == "return"
    allowed = "frame where plate.operator.task is return, and only there"
    require(
        not operated or returns == (plate.start == "frame"), "plate.start", plate.start, allowed
    )
    return Mounting(
        plate,
        _displaced(_taught(task, plate.magazine, "plate.magazine.at"), plate.magazine),
        _displaced(_taught(task, plate.frame, "plate.frame.at"), plate.frame),
    )


def _taught(task: PathTask, carrier: CarrierParameters, key: str) -> RigidTransform:
    """Return the tool's pose at an arc length of the path."""
    length = task.path.length
    require(carrier.at <= length, key, carrier.at, f"0 to {length:.6g} m, on the path")
    evaluator = task.path.evaluator(1)
    point = evaluator.evaluate_at(task.path.arc_length.parameter(carrier.at))
    layout = evaluator.layout
    R = quaternion_to_matrix(point[layout.quaternion][:4])
    return RigidTransform(RotationMatrix(R), point[layout.position][:3])


def _displaced(X_WC: RigidTransform, carrier: CarrierParameters) -> RigidTransform:
    shift, turn = carrier.misplacement()
    return X_WC @ RigidTransform(RotationMatrix(Rotation.from_rotvec(turn).as_matrix()), shift)


def tool_transform(start: StartPoint) -> RigidTransform:
    """Return the tool's pose at the start of an oriented task."""
    assert start.target.R_e is not None
    return RigidTransform(RotationMatrix(start.target.R_e), start.target.y_t)


REST_RADIUS = 2e-3  # m, of the bosses on which a plate lies
PAD = 0.02, 0.01  # m, side and height of the pads under the bosses


def add_plate_plant(
    builder: DiagramBuilder,
    parameters: PlateParameters,
    X_WM: RigidTransform,
    X_WF: RigidTransform,
    X_WPs: Sequence[RigidTransform],
    gravity: np.ndarray,
) -> tuple[MultibodyPlant, list[BodyIndex], PartnerForces]:
    """Add a plant of its own for the plates, K free bodies, with magazine and frame fixed in it.

    Args:
        builder: Builder of the diagram.
        parameters: The plates, the magazine and the frame.
        X_WM: Pose of a plate in the magazine.
        X_WF: Pose of a plate that is mounted.
        X_WPs: Poses of the K plates at the start.
        gravity: Gravitational acceleration, world axes [m/s^2], shape (3,).

    Returns:
        The plant, its plates, and the forces of frame and magazine on all plates, shape
        (6,) [N].
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
    return plant, bodies, contact


def pin_shape(parameters: PlateParameters) -> tuple[Capsule, float]:
    """Return a pin as a capsule, and the position of its middle along z of the plate [m].

    It begins within the plate by its radius, so that a cylinder with one round tip protrudes.
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
