"""Points of a serial arm by the names of its model."""

from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, Frame

from pfsc_drake.errors import InputError, suggestion
from pfsc_drake.robot.models.joint_edits import all_joints, bodies_of, frame_named
from pfsc_drake.robot.serial.chain_from_plant import PlantCoordinates


@dataclass(frozen=True, eq=False)
class LinkPoint:
    """Point fixed to a link of a chain.

    Attributes:
        name: Name of the model's link or frame that defines it.
        link: Index of the chain's link, from 0.
        p_LQ: Position in the chain's link frame [m], shape (3,).
        body: The plant's body that carries it.
        p_BQ: Position in that body's frame [m], shape (3,).
    """

    name: str
    link: int
    p_LQ: np.ndarray
    body: BodyIndex
    p_BQ: np.ndarray


def link_frames(plant: MultibodyPlant, coordinates: PlantCoordinates) -> list[Frame]:
    """Return a plant's frames L of a chain's links, base first.

    Args:
        plant: The plant that the chain was extracted from.
        coordinates: The chain's coordinates in the plant's state.
    """
    moving = {j.velocity_start(): j for j in all_joints(plant) if j.num_velocities() > 0}
    velocities = np.s_[len(coordinates.joints) :, plant.num_positions() :]
    frames = []
    for motor, link in zip(
        coordinates.motor_rows[velocities], coordinates.link_rows[velocities], strict=True
    ):
        # for an elastic joint the outer one, which turns the link against the motor
        flex = link - motor
        row = flex if flex.any() else motor
        frames.append(moving[int(np.argmax(row))].frame_on_child())
    return frames


def point_on_link(
    plant: MultibodyPlant, coordinates: PlantCoordinates, name: str, point: np.ndarray
) -> LinkPoint:
    """Return a point of a link or frame of a model.

    Args:
        plant: The plant that the chain was extracted from.
        coordinates: The chain's coordinates in the plant's state.
        name: Link or frame of the model that moves with a link of the chain.
        point: Position in that frame [m], shape (3,).

    Raises:
        InputError: If there is no such frame, or it does not move with a link.
    """
    links = link_frames(plant, coordinates)
    carriers = {
        body.index(): k
        for k, frame in enumerate(links)
        for body in plant.GetBodiesWeldedTo(frame.body())
    }
    frame = frame_named(plant, name)
    if frame is None or frame.body().index() not in carriers:
        problem = "does not move with a link" if frame is not None else "is not in the model"
        bodies = [body.name() for body in bodies_of(plant) if body.index() in carriers]
        raise InputError(
            f"'{name}' {problem}; allowed: {', '.join(bodies)}, and the frames that are on these"
            f"{suggestion(name, bodies)}"
        )
    k = carriers[frame.body().index()]
    X_LF = plant.CalcRelativeTransform(plant.CreateDefaultContext(), links[k], frame)
    return LinkPoint(
        name,
        k,
        X_LF @ np.asarray(point),
        frame.body().index(),
        frame.GetFixedPoseInBodyFrame() @ np.asarray(point),
    )
