"""The robot in a diagram."""

from pathlib import Path as FilePath

from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, FrameIndex, JointIndex
from pydrake.systems.framework import DiagramBuilder

from diagrams.scenario import RobotParameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.files import resolve_model
from pfsc_drake.robot.models.joint_edits import frame_named
from pfsc_drake.robot.models.reading import ModelOptions, read_model

# of a model that are worth naming; the last are those at the tool
_MOST_NAMES = 12


def read_robot(parameters: RobotParameters, folder: FilePath) -> tuple[MultibodyPlant, list[str]]:
    """Return a continuous plant with a robot, without geometry and in no diagram.

    Args:
        parameters: Which robot.
        folder: Where relative file names start.

    Returns:
        The plant, and what there is to say about the model, one sentence each.

    Raises:
        InputError: If the model cannot be read.
    """
    plant = MultibodyPlant(time_step=0.0)
    return plant, _read(plant, parameters, folder)


def add_visible_robot(
    builder: DiagramBuilder, parameters: RobotParameters, folder: FilePath
) -> tuple[MultibodyPlant, SceneGraph]:
    """Add a scene graph with a robot's geometry, and return it with the (unwired) plant.

    Args:
        builder: Builder of the diagram.
        parameters: Which robot.
        folder: Where relative file names start.

    Raises:
        InputError: If the model cannot be read.
    """
    plant = MultibodyPlant(time_step=0.0)
    scene_graph = builder.AddNamedSystem("scene_graph", SceneGraph())
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    _read(plant, parameters, folder)
    return plant, scene_graph


def _read(plant: MultibodyPlant, parameters: RobotParameters, folder: FilePath) -> list[str]:
    model = parameters.model
    if FilePath(model).suffix and not model.startswith("package://"):
        model = str(folder / model)
    try:
        return read_model(plant, resolve_model(model), parameters.options(folder))
    except InputError as error:
        # what starts with an option is about the key of that name, the rest about the file
        key = str(error).split(":")[0].split(".")[0]
        about_key = key in ModelOptions.__dataclass_fields__
        raise InputError(f"robot.{'' if about_key else 'model: '}{error}") from None


def tool_frame(plant: MultibodyPlant, parameters: RobotParameters) -> Frame:
    """Return the frame whose origin follows the path.

    Args:
        plant: Plant with the robot.
        parameters: Which robot.

    Raises:
        InputError: If the model has no such frame.
    """
    try:
        frame = frame_named(plant, parameters.tool_frame)
    except InputError as error:
        raise InputError(f"robot.tool_frame: {error}") from None
    if frame is None:
        frames = [plant.get_frame(FrameIndex(i)).name() for i in range(1, plant.num_frames())]
        joints = [plant.get_joint(JointIndex(i)).name() for i in plant.GetJointIndices()]
        # Drake's own frames at joints are not the user's
        made = {f"{joint}_{end}" for joint in joints for end in ("parent", "child", "base")}
        names = [name for name in frames if name and name not in made]
        raise InputError(
            f"robot.tool_frame: the model {parameters.model} has no frame "
            f"'{parameters.tool_frame}'; allowed: {', '.join(names[-_MOST_NAMES:])}"
        )
    return frame
