"""Nominal model of a robot in its controller, with the accuracy of its encoders."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from diagrams.robots.model import tool_frame
from diagrams.scenario import HolderWorkpiece, RobotParameters
from diagrams.scenario.model_error import ModelErrorParameters
from pfsc_drake.control.estimation.link_errors import MotorEncoders
from pfsc_drake.controller.nominal_robot import Coefficients, NominalRobot
from pfsc_drake.errors import InputError
from pfsc_drake.physics.joint_sensors import EncoderOptions, encoder_resolution
from pfsc_drake.robot.model_error import ModelError
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.serial.chain import ParametricChain, SerialChain, chain_parameters
from pfsc_drake.robot.tool_load import ToolLoad

# body of a workpiece that a robot holds, and its frame, which follows the path of the robot
WORKPIECE = "held_workpiece"


@dataclass(frozen=True)
class NominalModelSource:
    """Source of the nominal model of a robot.

    Attributes:
        robot: Robot of the plant.
        model: Another model to start from; empty for the model of the plant.
        error: Errors of the nominal model relative to that.
        folder: Base folder of relative file names.
        add_payload: Function that adds the payload of the robot, with the tool frame, to a plant;
            None without a payload.
        by_velocity: Whether velocity servos move the joints, for which kinematics suffice.
    """

    robot: RobotParameters
    model: str
    error: ModelErrorParameters
    folder: Path
    add_payload: Callable[[MultibodyPlant], None] | None = None
    by_velocity: bool = False

    def holding(self, workpiece: HolderWorkpiece) -> "NominalModelSource":
        """Return the source of a robot that holds a workpiece, with the workpiece's frame as tool.

        Args:
            workpiece: The workpiece, fixed to the tool frame of the robot alone.
        """
        grip = self.robot

        def add(plant: MultibodyPlant) -> None:
            if plant.HasBodyNamed(WORKPIECE):
                raise InputError(
                    f"holder.robot.model: {grip.model} has a link '{WORKPIECE}'; allowed: models "
                    "without one of that name"
                )
            frame = tool_frame(plant, grip)
            model = frame.body().model_instance()
            body = plant.AddRigidBody(WORKPIECE, model, workpiece.inertia)
            plant.WeldFrames(frame, body.body_frame(), workpiece.pose.transform())

        return replace(self, robot=replace(grip, tool_frame=WORKPIECE), add_payload=add)


@dataclass(frozen=True)
class NominalModel:
    """Nominal model of a robot, by which it is controlled.

    Attributes:
        robot: The model, N joints.
        error: Its errors relative to its source, the plant or another model.
        has_actual_kinematics: Whether measured joint positions give the actual pose of the tool.
    """

    robot: RobotModel
    error: ModelError
    has_actual_kinematics: bool = True

    @property
    def friction(self) -> np.ndarray:
        """Factors of Coulomb and viscous friction relative to the plant, shape (2, N)."""
        return self.error.friction

    def with_symbols(self) -> "NominalModel":
        """Return the model with symbols for the parameters of its robot, a serial chain."""
        assert isinstance(self.robot, SerialChain)
        return replace(self, robot=ParametricChain.of(self.robot))

    @property
    def parameters(self) -> dict[str, float]:
        """Values of these symbols, by name."""
        assert isinstance(self.robot, SerialChain)
        return chain_parameters(self.robot)

    def tool_load(self, load: ToolLoad) -> ToolLoad:
        """Return the nominal load behind a force/torque sensor.

        Args:
            load: The load without error.

        Raises:
            InputError: If its mass is negative.
        """
        error = self.error
        mass = load.mass * error.mass[-1] + error.tool_mass
        if not (mass > 0.0 or error.tool_mass == 0.0):
            least = f"more than {-load.mass * error.mass[-1]:g} kg, the mass behind the sensor"
            nothing = "0 kg or more; the sensor has no mass behind it"
            raise InputError(
                f"model_error.tool_mass = {error.tool_mass:g} kg; allowed: "
                f"{least if load.mass > 0.0 else nothing}"
            )
        return replace(
            load,
            mass=mass,
            p_SC=load.p_SC + load.R_ST @ error.tool_center,
            I_C=load.I_C * error.mass[-1] * error.inertia[-1],
        )


@contextmanager
def naming_model_error() -> Iterator[None]:
    """Name the block of the scenario in error messages about the model error."""
    try:
        yield
    except InputError as error:
        raise InputError(f"model_error.{error}") from None


def nominal_robot(
    robot: RobotModel,
    encoders: EncoderOptions,
    period: float,
    friction: Coefficients | None = None,
) -> NominalRobot:
    """Return a nominal robot with its friction and the accuracy of its encoders.

    Args:
        robot: The nominal model.
        encoders: Encoders of the joints.
        period: Sampling time of the controller [s].
        friction: Nominal friction coefficients f_c and f_v, each (N,), if there are any.

    Raises:
        InputError: If the encoders do not suit the robot.
    """
    late = period if encoders.difference_quotient else 0.0
    links, motors = encoder_resolution(robot.numeric, encoders)
    return NominalRobot(
        robot,
        friction,
        np.maximum(links, motors),
        velocity_delay=late / 2.0,
        filter_time=encoders.filter_time + late,
        motors=MotorEncoders(motors, encoders.difference_quotient, encoders.filter_time),
    )
