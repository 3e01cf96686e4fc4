"""What a controller believes of a robot, and of how well its motion is measured."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from diagrams.robots.model import tool_frame
from diagrams.scenario import HeldWorkpieceParameters, RobotParameters
from diagrams.scenario.model_error import ModelErrorParameters
from pfsc_drake.control.estimation.link_errors import MotorEncoders
from pfsc_drake.controller.believed import Believed, Coefficients
from pfsc_drake.errors import InputError
from pfsc_drake.physics.joint_sensors import EncoderOptions, encoder_resolution
from pfsc_drake.robot.model_error import ModelError
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.serial.chain import ParametricChain, SerialChain, chain_parameters
from pfsc_drake.robot.tool_load import ToolLoad

# body of a workpiece that a robot holds, and its frame, which follows the path of the robot
WORKPIECE = "held_workpiece"


@dataclass(frozen=True)
class BeliefSource:
    """Where what a controller believes of a robot comes from.

    Attributes:
        robot: Which robot the plant is.
        model: Another model that is believed; empty for the plant's own.
        error: By how much that is believed wrongly.
        folder: Where relative file names start.
        carried: Adds to the plant what the robot carries, with the tool frame, if it carries
            anything.
        by_velocity: Whether velocity servos move the joints, for which kinematics suffice.
    """

    robot: RobotParameters
    model: str
    error: ModelErrorParameters
    folder: Path
    carried: Callable[[MultibodyPlant], None] | None = None
    by_velocity: bool = False

    def holding(self, workpiece: HeldWorkpieceParameters) -> "BeliefSource":
        """Return the source of a robot that holds a workpiece, whose frame is its tool frame then.

        Args:
            workpiece: The workpiece; the tool frame of the robot alone is where it holds it.
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

        return replace(self, robot=replace(grip, tool_frame=WORKPIECE), carried=add)


@dataclass(frozen=True)
class Belief:
    """A robot as whatever controls it believes it to be.

    Attributes:
        robot: Its model, N joints.
        error: By how much that is off its own source, the plant or another model.
        sees_truth: Whether the tool is where the measured joints let one believe it to be.
    """

    robot: RobotModel
    error: ModelError
    sees_truth: bool = True

    @property
    def friction(self) -> np.ndarray:
        """Coulomb and viscous friction in units of the true ones, shape (2, N)."""
        return self.error.friction

    def with_symbols(self) -> "Belief":
        """Return the belief with symbols for the parameters of its robot, a serial chain."""
        assert isinstance(self.robot, SerialChain)
        return replace(self, robot=ParametricChain.of(self.robot))

    @property
    def parameters(self) -> dict[str, float]:
        """Values of these symbols, by name."""
        assert isinstance(self.robot, SerialChain)
        return chain_parameters(self.robot)

    def tool_load(self, load: ToolLoad) -> ToolLoad:
        """Return what is believed to be behind a force/torque sensor.

        Args:
            load: The load without error.

        Raises:
            InputError: If less than nothing would be left of it.
        """
        error = self.error
        mass = load.mass * error.mass[-1] + error.tool_mass
        if not (mass > 0.0 or error.tool_mass == 0.0):
            carried = f"more than {-load.mass * error.mass[-1]:g} kg, what the sensor carries"
            nothing = "0 kg or more; what is behind the sensor has no mass"
            raise InputError(
                f"model_error.tool_mass = {error.tool_mass:g} kg; allowed: "
                f"{carried if load.mass > 0.0 else nothing}"
            )
        return replace(
            load,
            mass=mass,
            p_SC=load.p_SC + load.R_ST @ error.tool_center,
            I_C=load.I_C * error.mass[-1] * error.inertia[-1],
        )


@contextmanager
def naming_model_error() -> Iterator[None]:
    """Name the block of the scenario in what is said against an error."""
    try:
        yield
    except InputError as error:
        raise InputError(f"model_error.{error}") from None


def believed_robot(
    robot: RobotModel,
    encoders: EncoderOptions,
    period: float,
    friction: Coefficients | None = None,
) -> Believed:
    """Return what a controller believes of a robot, and of how well its motion is measured.

    Args:
        robot: The robot as it is believed.
        encoders: What measures its joints.
        period: Sampling time of the controller [s].
        friction: Coefficients f_c and f_v that are believed, each (N,), if there are any.

    Raises:
        InputError: If the encoders do not suit the robot.
    """
    late = period if encoders.difference_quotient else 0.0
    links, motors = encoder_resolution(robot.numeric, encoders)
    return Believed(
        robot,
        friction,
        np.maximum(links, motors),
        velocity_delay=late / 2.0,
        filter_time=encoders.filter_time + late,
        motors=MotorEncoders(motors, encoders.difference_quotient, encoders.filter_time),
    )
