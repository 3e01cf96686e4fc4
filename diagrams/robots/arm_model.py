"""A serial arm as read from a model, true or believed."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path as FilePath

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, Joint

from diagrams.robots.belief import Belief, BeliefSource, naming_model_error
from diagrams.robots.model import read_robot, tool_frame
from diagrams.scenario import RobotParameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.joint_edits import inboard_joints
from pfsc_drake.robot.models.robot_parameters import VariantParameters, load_parameters
from pfsc_drake.robot.models.writer import write_sdf
from pfsc_drake.robot.serial.chain import SerialChain, believed_chain
from pfsc_drake.robot.serial.chain_from_plant import PlantCoordinates, chain_from_plant
from pfsc_drake.robot.serial.link_places import link_frames
from pfsc_drake.robot.tool_load import ToolLoad
from pfsc_drake.systems.plants.reactions import tool_load_from_plant


@dataclass(frozen=True)
class ArmModel:
    """A serial arm as read from a model.

    Attributes:
        plant: The arm as Drake knows it, finalized; bodies, frames and joints by name.
        chain: The same as data, N joints.
        coordinates: Where its coordinates stand in the state of ``plant``.
        tool: Frame whose origin follows the manifold.
        warnings: What there is to say about the model, one sentence each.
    """

    plant: MultibodyPlant
    chain: SerialChain
    coordinates: PlantCoordinates
    tool: Frame
    warnings: list[str]

    def sensor_joint(self, name: str) -> Joint:
        """Return the joint with the force/torque sensor in it.

        Args:
            name: Its name; empty for the fixed joint between the last moving link and the tool
                frame that is the nearest to the tool with some mass behind it, or, if nothing
                has mass there, the nearest to the link.

        Raises:
            InputError: If there is none of that name, or none at all.
        """
        if not name:
            return self._flange()
        if not self.plant.HasJointNamed(name):
            joints = [self.plant.get_joint(i).name() for i in self.plant.GetJointIndices()]
            raise InputError(
                f"sensor.joint: the model has no joint '{name}'; allowed: {', '.join(joints)}"
            )
        return self.plant.GetJointByName(name)

    def _flange(self) -> Joint:
        """Return the joint that fixes the tool to what is not the tool's own."""
        link = link_frames(self.plant, self.coordinates)[-1].body()
        inboard = inboard_joints(self.plant)
        body, flange, mass = self.tool.body(), None, 0.0
        while body.index() != link.index() and not mass > 0.0:
            mass += body.default_mass()
            flange = inboard[body.index()]
            body = flange.parent_body()
        if flange is None:
            raise InputError(
                f"sensor.joint: the tool frame '{self.tool.name()}' belongs to the last moving "
                f"link, '{link.name()}'; allowed: a tool frame on a link that is fixed to it, so "
                "that there is a joint for the sensor"
            )
        return flange

    def tool_load(self, joint: str) -> ToolLoad:
        """Return everything behind a sensor.

        Args:
            joint: Name of the joint with the sensor in it, or empty, see :meth:`sensor_joint`.

        Raises:
            InputError: If there is no such joint, or the tool frame is not behind it.
        """
        return tool_load_from_plant(self.plant, self.sensor_joint(joint), self.tool)

    def tool_mass(self) -> tuple[float, np.ndarray, str]:
        """Return what the tool frame's body weighs, where its centre of mass is, and its name.

        It weighs nothing where it is the last link's own. The centre is in the frame of that link.
        """
        body, link = self.tool.body(), link_frames(self.plant, self.coordinates)[-1]
        context = self.plant.CreateDefaultContext()
        if body.index() == link.body().index():
            return 0.0, self.chain.p_LT, body.name()
        center = body.CalcCenterOfMassInBodyFrame(context)
        X_LB = self.plant.CalcRelativeTransform(context, link, body.body_frame())
        return body.get_mass(context), X_LB @ center, body.name()


def read_arm(
    parameters: RobotParameters,
    folder: FilePath,
    time_step: float = 0.0,
    before_finalizing: Callable[[MultibodyPlant], None] | None = None,
    *,
    by_velocity: bool = False,
) -> ArmModel:
    """Read a serial arm.

    Args:
        parameters: Which robot.
        folder: Where relative file names start.
        time_step: Time step of the plant [s]; 0 for a continuous one.
        before_finalizing: What else is to be added to the plant.
        by_velocity: Whether velocity servos move the joints, for which kinematics suffice.

    Raises:
        InputError: If the model cannot be read, or is no chain of joints.
    """
    plant, warnings = read_robot(
        parameters, folder, time_step, before_finalizing, by_velocity=by_velocity
    )
    tool = tool_frame(plant, parameters)
    return ArmModel(plant, *chain_from_plant(plant, tool), tool, warnings)


def believe_arm(true: ArmModel, source: BeliefSource) -> tuple[Belief, ArmModel]:
    """Return what the controller believes of an arm, and the model that this starts from.

    Args:
        true: The arm of the plant.
        source: Where the belief comes from.

    Raises:
        InputError: If what is to be believed cannot be read or suits no such arm.
    """
    model = _model(true, source)
    error, believed = source.error.error(true.chain.gather("is_revolute")), model.chain
    if source.error.is_given:
        with naming_model_error():
            believed = believed_chain(model.chain, error, *model.tool_mass())
    sees_truth = model is true and not error.moves_tool
    return Belief(believed, error, sees_truth), model


def _model(true: ArmModel, source: BeliefSource) -> ArmModel:
    """Return the model that a belief starts from."""
    model, key = source.model, "controller.model"
    if not model:
        return true
    try:
        if FilePath(model).suffix in (".yaml", ".yml"):
            found = _from_parameters(source.folder / model, true, source)
        else:
            robot = replace(source.robot, model=model)
            found = read_arm(
                robot,
                source.folder,
                before_finalizing=source.carried,
                by_velocity=source.by_velocity,
            )
    except InputError as error:
        message = str(error).removeprefix("robot.model: ")
        raise InputError(f"{key}: {message}") from None
    if found.chain.is_massless != true.chain.is_massless:
        has = "no masses" if found.chain.is_massless else "masses"
        raise InputError(f"{key} = {model}: has {has}, unlike the robot; allowed: a model like it")
    kinds, own = found.chain.gather("kind").tolist(), true.chain.gather("kind").tolist()
    if kinds != own:
        raise InputError(
            f"{key} = {model}: has the joints {', '.join(kinds)}; allowed: the robot's, "
            f"{', '.join(own)}"
        )
    return found


def _from_parameters(file: FilePath, true: ArmModel, source: BeliefSource) -> ArmModel:
    """Read the variant of a parameter file that has joints like the plant's."""
    robot, elastic = load_parameters(file), not true.chain.is_rigid
    axes = len(robot.links)
    for variant in robot.variants:
        if (axes - variant.fixed_deg.size, bool(variant.elasticity)) == (
            true.chain.dimension,
            elastic,
        ):
            break
    else:
        if true.chain.dimension != axes or elastic:
            raise InputError(
                f"{file}: none of its variants has {true.chain.dimension} "
                f"{'elastic' if elastic else 'rigid'} joints; allowed: parameters with one"
            )
        variant = VariantParameters(name=robot.name)
    with tempfile.TemporaryDirectory() as scratch:
        model = FilePath(scratch) / f"{variant.name}.sdf"
        model.write_text(write_sdf(robot, variant), encoding="utf-8")
        written = replace(source.robot, model=str(model))
        return read_arm(written, source.folder, before_finalizing=source.carried)
