"""Reading the robot of a diagram: an arm's plant, or a DELTA robot."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as FilePath

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    Frame,
)

from diagrams.scenario import (
    RobotParameters,
)
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.errors import InputError, suggestion
from pfsc_drake.robot.delta.delta_parameters import SHIPPED_ROBOTS, load_delta_parameters
from pfsc_drake.robot.delta.delta_robot import DeltaRobot
from pfsc_drake.robot.models.files import packages_for, read_with_inclusions, resolve_model
from pfsc_drake.robot.models.joint_edits import frame_named, model_frames
from pfsc_drake.robot.models.model_xml import read_model_xml
from pfsc_drake.robot.models.reading import ModelOptions, read_model
from pfsc_drake.yaml.reading import read_yaml

# names of a model's frames in a message; the last are those at the tool
_MOST_NAMES = 12


def read_robot(
    parameters: RobotParameters,
    folder: FilePath,
    time_step: float = 0.0,
    before_finalizing: Callable[[MultibodyPlant], None] | None = None,
    *,
    by_velocity: bool = False,
) -> tuple[MultibodyPlant, list[str]]:
    """Return a plant with a robot, without the robot's geometry and in no diagram.

    Args:
        parameters: The robot.
        folder: Base folder of relative file names.
        time_step: Time step of the plant [s]; 0 for a continuous one.
        before_finalizing: Function that adds further bodies to the plant.
        by_velocity: Whether velocity servos move the joints, for which kinematics suffice.

    Returns:
        The plant, and warnings about the model, one sentence each.

    Raises:
        InputError: If the model cannot be read.
    """
    file = locate_model(parameters, folder)
    options = replace(parameters.options(folder), by_velocity=by_velocity)
    try:
        if before_finalizing is None:
            read, warnings = _read_once(time_step, file, _text_of(file, options), options)
            return read.Clone(), [*warnings]
        plant = MultibodyPlant(time_step)
        return plant, read_model(plant, file, options, before_finalizing)
    except InputError as error:
        # a message that starts with an option is about that key, one with the file about the file
        key = str(error).split(":")[0].split(".")[0]
        if key in ModelOptions.__dataclass_fields__:
            raise InputError(f"robot.{error}") from None
        if str(error).startswith(str(file.parent)):
            raise InputError(f"robot.model: {error}") from None
        raise


@once_per_content(20)
def _read_once(
    time_step: float, file: FilePath, _text: list[bytes], options: ModelOptions
) -> tuple[MultibodyPlant, tuple[str, ...]]:
    """Return a plant to be copied, which takes a fiftieth of the time of reading it."""
    plant = MultibodyPlant(time_step)
    return plant, tuple(read_model(plant, file, options))


def _text_of(file: FilePath, options: ModelOptions) -> list[bytes]:
    """Return the contents of a model's file and of all files that it includes."""
    packages = packages_for(file, read_model_xml(file).content, options.packages)
    return [model.content for model in read_with_inclusions(file, packages)]


def locate_model(parameters: RobotParameters, folder: FilePath) -> FilePath:
    """Return the file of a robot's model.

    Args:
        parameters: The robot.
        folder: Base folder of relative file names.

    Raises:
        InputError: If there is no such file.
    """
    model = parameters.model
    if FilePath(model).suffix and not model.startswith("package://"):
        model = str(folder / model)
    try:
        return resolve_model(model)
    except InputError as error:
        raise InputError(f"robot.model: {error}") from None


def tool_frame(plant: MultibodyPlant, parameters: RobotParameters) -> Frame:
    """Return the frame whose origin follows the path.

    Args:
        plant: Plant with the robot.
        parameters: The robot.

    Raises:
        InputError: If the model has no such frame.
    """
    try:
        frame = frame_named(plant, parameters.tool_frame)
    except InputError as error:
        raise InputError(f"robot.tool_frame: {error}") from None
    if frame is None:
        names = [one.name() for one in model_frames(plant)]
        raise InputError(
            f"robot.tool_frame: the model {parameters.model} has no frame "
            f"'{parameters.tool_frame}'; allowed: {', '.join(names[-_MOST_NAMES:])}"
            f"{suggestion(parameters.tool_frame, names)}"
        )
    return frame


def is_delta(model: str) -> bool:
    """Return whether a robot model is a DELTA robot: a shipped one, or a file of parameters."""
    return model in SHIPPED_ROBOTS or FilePath(model).suffix in (".yaml", ".yml")


def load_delta_robot(model: str, folder: FilePath) -> DeltaRobot:
    """Return a DELTA robot.

    Args:
        model: Name of a shipped one, or file of parameters.
        folder: Base folder of relative file names.

    Raises:
        InputError: If its parameters cannot be read, or are Drake's model directives.
    """
    if model in SHIPPED_ROBOTS:
        return DeltaRobot(load_delta_parameters(model))
    file = folder / model
    if "directives" in read_yaml(file):
        raise InputError(
            f"{file}: Drake's model directives are not read; allowed: the URDF, SDF or MJCF file "
            "of one arm (robot.base, base_pose and fixed_joints say what the directives say), or "
            "the parameters of a DELTA robot (*.yaml)"
        )
    return DeltaRobot(load_delta_parameters(file))
