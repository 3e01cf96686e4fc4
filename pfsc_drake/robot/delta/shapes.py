"""Visual shapes of a DELTA robot with linear drives; their dimensions are for display only.

Every part is given in axes of the inertial frame (z_0 down) and moves with one of the carriers:
the base, a slide's joint point B_i, or the end-effector's centre E.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Box, Capsule, Cylinder, Rgba, Shape
from pydrake.math import RigidTransform, RotationMatrix

from pfsc_drake.robot.delta.delta_parameters import NUM_ARMS, DeltaGeometry, DeltaParameters
from pfsc_drake.robot.delta.kinematics import rod_vectors

BASE, PLATE = "base", "end_effector"

BODY = Rgba(0.93, 0.93, 0.92, 1.0)
DARK = Rgba(0.16, 0.17, 0.19, 1.0)
ACCENT = Rgba(0.02, 0.53, 0.82, 1.0)
METAL = Rgba(0.62, 0.64, 0.67, 1.0)

ROD_RADIUS = 0.007
_ROD_SPACING = 0.09  # of the two rods of a parallelogram
_RAIL_WIDTH, _RAIL_HEIGHT = 0.06, 0.035
_RAIL_DISTANCE = 0.05  # of the rail's centre line from the line that B_i moves on
_SLIDE_LENGTH, _SLIDE_WIDTH, _SLIDE_HEIGHT = 0.10, 0.08, 0.03
_END_MARGIN = 0.06  # of the rail beyond the slide's travel
_BASE_HEIGHT = 0.03


@dataclass(frozen=True)
class Part:
    """One shape of the robot.

    Attributes:
        name: Unique name.
        carrier: ``"base"``, ``"end_effector"`` or a slide's name ``"slide_i"``.
        shape: Drake shape.
        X_CS: Pose of the shape in the carrier; the carriers' axes are the inertial frame's.
        color: Its colour.
    """

    name: str
    carrier: str
    shape: Shape
    X_CS: RigidTransform
    color: Rgba


def robot_parts(parameters: DeltaParameters) -> list[Part]:
    """Return base, rails, slides and end-effector plate; the rods are not among them.

    Args:
        parameters: The robot.
    """
    return [
        *_base_parts(parameters.geometry),
        *(part for i in range(NUM_ARMS) for part in _arm_parts(parameters, i)),
        *_plate_parts(parameters.geometry),
    ]


def slide_origins(geometry: DeltaGeometry, q: np.ndarray) -> np.ndarray:
    """Return the points ``B_i = l_A e_xi - q_i c_i`` by rows [m], shape (3, 3).

    Args:
        geometry: Dimensions of the robot.
        q: Slide positions [m], shape (3,).
    """
    return geometry.l_A * geometry.directions - np.asarray(q)[:, None] * geometry.rails


def rod_shape(geometry: DeltaGeometry) -> Shape:
    """Return the shape of a rod; its z axis runs from the slide to the plate."""
    return Capsule(ROD_RADIUS, geometry.l_BC)


def rod_poses(geometry: DeltaGeometry, q: np.ndarray, y_t: np.ndarray) -> list[RigidTransform]:
    """Return the poses of the six rods in the inertial frame, two per arm.

    Args:
        geometry: Dimensions of the robot.
        q: Slide positions [m], shape (3,).
        y_t: End-effector position that belongs to them [m], shape (3,).
    """
    poses = []
    rods = rod_vectors(geometry, q, y_t)
    for i, B in enumerate(slide_origins(geometry, q)):
        R = RotationMatrix.MakeFromOneVector(rods[i], 2)
        for side in (-0.5, 0.5):
            beside = side * _ROD_SPACING * _tangent(geometry, i)
            poses.append(RigidTransform(R, B + beside + rods[i] / 2.0))
    return poses


def _tangent(geometry: DeltaGeometry, arm: int) -> np.ndarray:
    """Return the unit vector along the base, across the rail."""
    return np.cross([0.0, 0.0, 1.0], geometry.directions[arm])


def _beam(
    start: np.ndarray, end: np.ndarray, lateral: np.ndarray, width: float, height: float
) -> tuple[Box, RigidTransform]:
    """Return a box that runs from start to end, with its width along the lateral unit vector."""
    along = (end - start) / np.linalg.norm(end - start)
    R = RotationMatrix(np.column_stack([along, lateral, np.cross(along, lateral)]))
    shape = Box(float(np.linalg.norm(end - start)), width, height)
    return shape, RigidTransform(R, (start + end) / 2.0)


def _base_parts(geometry: DeltaGeometry) -> Sequence[Part]:
    above = np.array([0.0, 0.0, -_BASE_HEIGHT - _RAIL_DISTANCE])
    hub = Cylinder(0.35 * geometry.l_A, _BASE_HEIGHT)
    parts = [Part("hub", BASE, hub, RigidTransform(above), BODY)]
    corners = geometry.l_A * geometry.directions + above
    for i in range(NUM_ARMS):
        spoke = _beam(above, corners[i], _tangent(geometry, i), 0.08, 0.9 * _BASE_HEIGHT)
        parts.append(Part(f"spoke_{i + 1}", BASE, *spoke, BODY))
        side = corners[(i + 1) % NUM_ARMS] - corners[i]
        lateral = np.cross([0.0, 0.0, 1.0], side / np.linalg.norm(side))
        beam = _beam(corners[i], corners[(i + 1) % NUM_ARMS], lateral, 0.05, 0.8 * _BASE_HEIGHT)
        parts.append(Part(f"beam_{i + 1}", BASE, *beam, DARK))
    return parts


def _arm_parts(parameters: DeltaParameters, arm: int) -> Sequence[Part]:
    geometry, drives = parameters.geometry, parameters.drives
    lateral, along = _tangent(geometry, arm), -geometry.rails[arm]
    away = np.cross(along, lateral)  # from the rods to the rail
    upper_end = geometry.l_A * geometry.directions[arm] + _RAIL_DISTANCE * away
    limits = (drives.position_lower[arm] - _END_MARGIN, drives.position_upper[arm] + _END_MARGIN)
    start, end = (upper_end + q * along for q in limits)
    rail = _beam(start, end, lateral, _RAIL_WIDTH, _RAIL_HEIGHT)
    half = _SLIDE_LENGTH / 2.0 * along
    lift = (_RAIL_DISTANCE - (_RAIL_HEIGHT + _SLIDE_HEIGHT) / 2.0) * away
    block = _beam(lift - half, lift + half, lateral, _SLIDE_WIDTH, _SLIDE_HEIGHT)
    slide = f"slide_{arm + 1}"
    return [
        Part(f"rail_{arm + 1}", BASE, *rail, METAL),
        Part(f"{slide}_block", slide, *block, ACCENT),
        Part(f"{slide}_axle", slide, *_axle(lateral, np.zeros(3)), DARK),
    ]


def _plate_parts(geometry: DeltaGeometry) -> Sequence[Part]:
    plate = Cylinder(geometry.l_EC, 0.014)
    parts = [Part("plate", PLATE, plate, RigidTransform(), ACCENT)]
    for i, direction in enumerate(geometry.directions):
        axle = _axle(_tangent(geometry, i), geometry.l_EC * direction)
        parts.append(Part(f"plate_axle_{i + 1}", PLATE, *axle, DARK))
    return parts


def _axle(lateral: np.ndarray, center: np.ndarray) -> tuple[Cylinder, RigidTransform]:
    """Return the axle that holds the ends of the two rods of an arm."""
    shape = Cylinder(1.2 * ROD_RADIUS, _ROD_SPACING + 4.0 * ROD_RADIUS)
    return shape, RigidTransform(RotationMatrix.MakeFromOneVector(lateral, 2), center)
