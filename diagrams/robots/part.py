"""A robot in a diagram, with any kinematics and any plant."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort

from diagrams.robots.nominal_model import NominalModel, NominalModelSource
from diagrams.scenario import StartParameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.inverse_kinematics import ToolTarget
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.serial.chain_from_plant import PlantCoordinates
from pfsc_drake.robot.tool_load import ToolLoad
from pfsc_drake.systems.plants.reactions import ContactWrench

# output ports by the names of their signals
Ports = dict[str, OutputPort]


@dataclass(frozen=True)
class Drives:
    """Drives of a robot, on which friction acts.

    Attributes:
        inertia: Least inertia behind each drive, shape (N,) [kg m^2 or kg]; zero where a drive
            has none of its own.
        own_friction: Coulomb and viscous friction in the robot's parameters, each (N,), or None.
        step: Step by which the plant's state advances [s], if it is discrete.
    """

    inertia: np.ndarray
    own_friction: tuple[np.ndarray, np.ndarray] | None = None
    step: float | None = None


@dataclass(frozen=True)
class SensorMount:
    """Mount of a force/torque sensor.

    Attributes:
        load: Load behind the sensor.
        nominal_load: Load behind the sensor in the controller's model.
        reaction: Reaction ``[torque, force]`` on the tool, shape (6,), or abstract, all
            reactions of a plant; None for a sensor in another process.
        index: Index of the sensor's joint in the plant's reactions, or None.
        reading: Reading of a sensor in another process, axes of the sensor, shape (6,) [N, Nm].
    """

    load: ToolLoad
    nominal_load: ToolLoad
    reaction: OutputPort | None
    index: int | None = None
    reading: OutputPort | None = None


class RobotPart(ABC):
    """A robot in a diagram, with its inputs and outputs.

    Attributes:
        robot: The simulated robot, N joints.
        nominal_model: Nominal model of the robot, by which it is controlled.
        coordinates: Indices of its coordinates in the state ``[q, v]`` of its model.
        contact: Contact wrench on its tool, if the environment can touch it.
    """

    robot: RobotModel
    nominal_model: NominalModel
    coordinates: PlantCoordinates
    contact: ContactWrench | None = None

    @property
    @abstractmethod
    def plant(self) -> LeafSystem:
        """The plant."""

    @property
    @abstractmethod
    def gravity(self) -> np.ndarray:
        """Gravitational acceleration in the world [m/s^2], shape (3,)."""

    @property
    @abstractmethod
    def drives(self) -> Drives:
        """Drives that friction acts on."""

    @abstractmethod
    def joint_state(self, builder: DiagramBuilder) -> OutputPort:
        """Return the actual ``[q_J, v_J, q_M, v_M]``, shape (4N,)."""

    @abstractmethod
    def connect_drives(self, builder: DiagramBuilder, torque: OutputPort) -> None:
        """Apply drive torques ``tau_d``, shape (N,)."""

    @abstractmethod
    def connect_resistance(self, builder: DiagramBuilder, resistance: OutputPort) -> None:
        """Apply the friction torques ``-tau_fM`` to the motors, shape (N,)."""

    @abstractmethod
    def connect_wrench(
        self, builder: DiagramBuilder, wrench: OutputPort, joint_state: OutputPort
    ) -> None:
        """Apply a wrench at the tool point, world axes, shape (6,).

        Args:
            builder: Builder of the diagram.
            wrench: The wrench [N, Nm].
            joint_state: Actual ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        """

    @abstractmethod
    def sensor_mount(self, builder: DiagramBuilder, joint: str, ports: Ports) -> SensorMount:
        """Return the mount of a force/torque sensor.

        Args:
            builder: Builder of the diagram.
            joint: Fixed joint of the model with the sensor in it; empty for the one at the flange.
            ports: ``true_joint_state``, and ``wrench_ext`` on the tool point, world axes, shape
                (6,), if forces act there.

        Raises:
            InputError: If the model has no such joint, or no tool behind it.
        """

    @abstractmethod
    def nominal_load(self, joint: str) -> ToolLoad:
        """Return the nominal load behind a sensor.

        Args:
            joint: Fixed joint of the model with the sensor in it; empty for the one at the flange.

        Raises:
            InputError: If the model has no such joint, or no tool behind it.
        """

    def hang(self, context: Context, joint: str, mass: float) -> None:
        """Add an unmodelled mass below a force sensor, at the centre of the load.

        Args:
            context: Context of the plant.
            joint: Fixed joint of the model with the sensor in it; empty for the one at the flange.
            mass: The mass [kg].

        Raises:
            InputError: If the masses of the plant cannot be changed.
        """
        del context, joint, mass
        raise InputError("masses of this robot's plant cannot be changed once it is built")

    @abstractmethod
    def check_nominal_model(self, source: NominalModelSource, sensor_joint: str | None) -> None:
        """Refuse a nominal model that no controller of this robot could have; nothing is built.

        Args:
            source: Source of the nominal model, of the same robot.
            sensor_joint: The joint with a force sensor in it, or empty for the default one; None
                without a sensor.

        Raises:
            InputError: If the nominal model of robot or tool is invalid.
        """

    @abstractmethod
    def posture(self, target: ToolTarget, start: StartParameters) -> np.ndarray:
        """Return the joint coordinates at the start pose of the tool, shape (N,).

        Args:
            target: The pose.
            start: Start parameters of the scenario.

        Raises:
            InputError: If the pose is out of reach.
        """

    def start_warnings(
        self, start: StartParameters, q_J: np.ndarray, target: ToolTarget
    ) -> list[str]:
        """Return warnings about the robot and its start, one sentence each.

        Args:
            start: Start parameters of the scenario.
            q_J: Joint coordinates at the start, shape (N,).
            target: Start pose of the tool.
        """
        return []

    @abstractmethod
    def state_at_rest(self, q_J: np.ndarray) -> np.ndarray:
        """Return the state of the model at rest, elastic joints deflected by the links' weight.

        Args:
            q_J: Joint coordinates, shape (N,).
        """

    def check_reach(self, position: np.ndarray, where: str) -> None:  # noqa: B027
        """Refuse a position of the tool that the robot is known not to reach.

        Args:
            position: Position of the tool point [m], shape (3,).
            where: Name of the position, for the message.

        Raises:
            InputError: If it is out of reach. The default accepts every position.
        """

    @abstractmethod
    def set_state(self, context: Context, state: np.ndarray) -> None:
        """Set the state ``[q, v]`` of the model in the plant.

        Args:
            context: Context of the plant.
            state: The state, shape (num_states,), see :class:`PlantCoordinates`.
        """
