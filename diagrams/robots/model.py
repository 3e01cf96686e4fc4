"""The robot in a diagram."""

from collections.abc import Callable
from pathlib import Path as FilePath

import numpy as np
from pydrake.multibody.parsing import PackageMap, Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    ForceElementIndex,
    Frame,
    Joint,
    JointIndex,
    PrismaticSpring,
    RevoluteSpring,
)

from diagrams.scenario import RobotParameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import add_models_to, resolve_model


def read_robot(
    parameters: RobotParameters,
    folder: FilePath,
    time_step: float = 0.0,
    before_finalizing: Callable[[MultibodyPlant], None] | None = None,
) -> MultibodyPlant:
    """Return a plant with a robot, without the robot's geometry and in no diagram.

    Args:
        parameters: Which robot.
        folder: Where relative file names start.
        time_step: Of the plant [s]; 0 for a continuous one.
        before_finalizing: What else is to be added to the plant.

    Raises:
        InputError: If the model cannot be read.
    """
    plant = MultibodyPlant(time_step)
    _parse(plant, parameters, folder)
    if before_finalizing is not None:
        before_finalizing(plant)
    plant.Finalize()
    return plant


def locate_model(parameters: RobotParameters, folder: FilePath, packages: PackageMap) -> FilePath:
    """Return the file of a robot's model, and make the packages known that it may refer to.

    Args:
        parameters: Which robot.
        folder: Where relative file names start.
        packages: Packages known to the parser; gets further ones.

    Raises:
        InputError: If there is no such file.
    """
    add_models_to(packages)
    model = parameters.model
    if FilePath(model).suffix and not model.startswith("package://"):
        model = str(folder / model)
    return resolve_model(model)


def _parse(plant: MultibodyPlant, parameters: RobotParameters, folder: FilePath) -> None:
    parser = Parser(plant)
    file = locate_model(parameters, folder, parser.package_map())
    try:
        parser.AddModels(str(file))
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise InputError(f"robot.model: {file}: cannot be read: {reason}") from None
    if parameters.joint_damping:
        _set_joint_damping(plant, parameters)


def _set_joint_damping(plant: MultibodyPlant, parameters: RobotParameters) -> None:
    """Give the sprung joints, base first, another damping ``K_d`` than the model's."""
    inboard = {joint.child_body().index(): joint for joint in _joints(plant)}
    springs = (
        plant.get_force_element(ForceElementIndex(i)) for i in range(plant.num_force_elements())
    )
    sprung = [s.joint() for s in springs if isinstance(s, RevoluteSpring | PrismaticSpring)]

    def depth(joint: Joint) -> int:
        below = inboard.get(joint.parent_body().index())
        return 0 if below is None else 1 + depth(below)

    damping = parameters.joint_damping
    if len(damping) != len(sprung):
        raise InputError(
            f"robot.joint_damping: {len(damping)} values; the model {parameters.model} has "
            f"{len(sprung)} elastic joints"
        )
    for joint, K_d in zip(sorted(sprung, key=depth), damping, strict=True):
        joint.set_default_damping_vector(np.array([K_d]))


def _joints(plant: MultibodyPlant) -> list[Joint]:
    return [plant.get_joint(JointIndex(i)) for i in plant.GetJointIndices()]


def tool_frame(plant: MultibodyPlant, parameters: RobotParameters) -> Frame:
    """Return the frame whose origin follows the path.

    Args:
        plant: Plant with the robot.
        parameters: Which robot.

    Raises:
        InputError: If the model has no such frame.
    """
    if not plant.HasFrameNamed(parameters.tool_frame):
        raise InputError(
            f"robot.tool_frame: the model {parameters.model} has no frame '{parameters.tool_frame}'"
        )
    return plant.GetFrameByName(parameters.tool_frame)
