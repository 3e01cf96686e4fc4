"""A serial arm as read from a model, actual or nominal."""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path as FilePath

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, Joint

from diagrams.robots.model import read_robot, tool_frame
from diagrams.robots.nominal_model import NominalModel, NominalModelSource, naming_model_error
from diagrams.scenario import RobotParameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.joint_edits import inboard_joints
from pfsc_drake.robot.models.robot_parameters import VariantParameters, load_parameters
from pfsc_drake.robot.models.writer import write_sdf
from pfsc_drake.robot.serial.chain import SerialChain, nominal_chain
from pfsc_drake.robot.serial.chain_from_plant import PlantCoordinates, chain_from_plant
from pfsc_drake.robot.serial.link_points import link_frames
from pfsc_drake.robot.tool_load import ToolLoad
from pfsc_drake.systems.plants.reactions import tool_load_from_plant


@dataclass(frozen=True)
class ArmModel:
    """A serial arm as read from a model.

    Attributes:
        plant: Drake's model of the arm, finalized; bodies, frames and joints by name.
        chain: Parameters of the arm, N joints.
        coordinates: Indices of its coordinates in the state of ``plant``.
        tool: Frame whose origin follows the manifold.
        warnings: Warnings about the model, one sentence each.
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
            InputError: If there is no such joint.
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
        """Return the joint that fixes the tool to the last link."""
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
        """Return mass, centre of mass and name of the body with the tool frame.

        The mass is zero if that body is the last link. The centre is in the frame of that link.
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
        parameters: The robot.
        folder: Base folder of relative file names.
        time_step: Time step of the plant [s]; 0 for a continuous one.
        before_finalizing: Function that adds further bodies to the plant.
        by_velocity: Whether velocity servos move the joints, for which kinematics suffice.

    Raises:
        InputError: If the model cannot be read, or is no chain of joints.
    """
    plant, warnings = read_robot(
        parameters, folder, time_step, before_finalizing, by_velocity=by_velocity
    )
    tool = tool_frame(plant, parameters)
    return ArmModel(plant, *chain_from_plant(plant, tool), tool, warnings)


def nominal_arm(actual: ArmModel, source: NominalModelSource) -> tuple[NominalModel, ArmModel]:
    """Return the nominal model of an arm, and the model that it is derived from.

    Args:
        actual: The arm of the plant.
        source: Source of the nominal model.

    Raises:
        InputError: If the nominal model cannot be read or does not suit the arm.
    """
    model = _model(actual, source)
    error, chain = source.error.error(actual.chain.gather("is_revolute")), model.chain
    if source.error.is_given:
        with naming_model_error():
            chain = nominal_chain(model.chain, error, *model.tool_mass())
    has_actual_kinematics = model is actual and not error.moves_tool
    return NominalModel(chain, error, has_actual_kinematics), model


def _model(actual: ArmModel, source: NominalModelSource) -> ArmModel:
    """Return the model that the nominal model is derived from."""
    model, key = source.model, "controller.model"
    if not model:
        return actual
    try:
        if FilePath(model).suffix in (".yaml", ".yml"):
            found = _from_parameters(source.folder / model, actual, source)
        else:
            robot = replace(source.robot, model=model)
            found = read_arm(
                robot,
                source.folder,
                before_finalizing=source.add_payload,
                by_velocity=source.by_velocity,
            )
    except InputError as error:
        message = str(error).removeprefix("robot.model: ")
        raise InputError(f"{key}: {message}") from None
    if found.chain.is_massless != actual.chain.is_massless:
        has = "no masses" if found.chain.is_massless else "masses"
        raise InputError(f"{key} = {model}: has {has}, unlike the robot; allowed: a model like it")
    kinds, own = found.chain.gather("kind").tolist(), actual.chain.gather("kind").tolist()
    if kinds != own:
        raise InputError(
            f"{key} = {model}: has the joints {', '.join(kinds)}; allowed: the robot's, "
            f"{', '.join(own)}"
        )
    return found


def _from_parameters(file: FilePath, actual: ArmModel, source: NominalModelSource) -> ArmModel:
    """Read the variant of a parameter file that has joints like the plant's."""
    robot, elastic = load_parameters(file), not actual.chain.is_rigid
    axes = len(robot.links)
    for variant in robot.variants:
        if (axes - variant.fixed_deg.size, bool(variant.elasticity)) == (
            actual.chain.dimension,
            elastic,
        ):
            break
    else:
        if actual.chain.dimension != axes or elastic:
            raise InputError(
                f"{file}: none of its variants has {actual.chain.dimension} "
                f"{'elastic' if elastic else 'rigid'} joints; allowed: parameters with one"
            )
        variant = VariantParameters(name=robot.name)
    with tempfile.TemporaryDirectory() as scratch:
        model = FilePath(scratch) / f"{variant.name}.sdf"
        model.write_text(write_sdf(robot, variant), encoding="utf-8")
        written = replace(source.robot, model=str(model))
        return read_arm(written, source.folder, before_finalizing=source.add_payload)
