"""A robot in a diagram, whatever its kinematics and whichever model moves it."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort

from diagrams.robots.belief import Belief, BeliefSource
from diagrams.scenario import StartParameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.inverse_kinematics import ToolTarget
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.serial.chain_from_plant import PlantCoordinates
from pfsc_drake.robot.tool_load import ToolLoad
from pfsc_drake.systems.plants.reactions import ContactWrench

# output ports by what they carry
Ports = dict[str, OutputPort]


@dataclass(frozen=True)
class Drives:
    """What friction acts on.

    Attributes:
        inertia: Least inertia behind each drive, shape (N,) [kg m^2 or kg]; zero where a drive
            has none of its own.
        own_friction: Coulomb and viscous friction that the robot's parameters tell, each (N,),
            or None if they do not.
        step: Step by which the plant's state advances [s], if it is discrete.
    """

    inertia: np.ndarray
    own_friction: tuple[np.ndarray, np.ndarray] | None = None
    step: float | None = None


@dataclass(frozen=True)
class SensorMount:
    """Where a force/torque sensor sits.

    Attributes:
        load: Everything behind the sensor.
        believed_load: The same as the controller believes it to be.
        reaction: Reaction ``[torque, force]`` on the tool, shape (6,), or abstract, all
            reactions of a plant; None where the sensor itself is elsewhere.
        index: Index of the sensor's joint in the plant's reactions, or None.
        reading: What a sensor elsewhere measures, its axes, shape (6,) [N, Nm].
    """

    load: ToolLoad
    believed_load: ToolLoad
    reaction: OutputPort | None
    index: int | None = None
    reading: OutputPort | None = None


class RobotPart(ABC):
    """A robot in a diagram: where its signals come from and where they go.

    Attributes:
        robot: The robot as it is, N joints.
        belief: The robot as whatever controls it believes it to be.
        coordinates: Where its coordinates stand in the state ``[q, v]`` of its model.
        contact: What the environment does to its tool, if it can touch them.
    """

    robot: RobotModel
    belief: Belief
    coordinates: PlantCoordinates
    contact: ContactWrench | None = None

    @property
    @abstractmethod
    def plant(self) -> LeafSystem:
        """The system in the diagram that moves."""

    @property
    @abstractmethod
    def gravity(self) -> np.ndarray:
        """Gravitational acceleration in the world [m/s^2], shape (3,)."""

    @property
    @abstractmethod
    def drives(self) -> Drives:
        """What friction acts on."""

    @abstractmethod
    def joint_state(self, builder: DiagramBuilder) -> OutputPort:
        """Return the true ``[q_J, v_J, q_M, v_M]``, shape (4N,)."""

    @abstractmethod
    def connect_drives(self, builder: DiagramBuilder, torque: OutputPort) -> None:
        """Let drive torques ``tau_d`` act, shape (N,)."""

    @abstractmethod
    def connect_resistance(self, builder: DiagramBuilder, resistance: OutputPort) -> None:
        """Let the friction torques ``-tau_fM`` act on the motors, shape (N,)."""

    @abstractmethod
    def connect_wrench(
        self, builder: DiagramBuilder, wrench: OutputPort, joint_state: OutputPort
    ) -> None:
        """Let a wrench act at the tool point, world axes, shape (6,).

        Args:
            builder: Builder of the diagram.
            wrench: The wrench [N, Nm].
            joint_state: The true one.
        """

    @abstractmethod
    def sensor_mount(self, builder: DiagramBuilder, joint: str, ports: Ports) -> SensorMount:
        """Return where a force/torque sensor sits.

        Args:
            builder: Builder of the diagram.
            joint: Fixed joint of the model with the sensor in it; empty for that at the flange.
            ports: ``true_joint_state``, and ``wrench_ext`` on the tool point, world axes, shape
                (6,), if anything acts there.

        Raises:
            InputError: If the model has no such joint, or no tool behind it.
        """

    @abstractmethod
    def believed_load(self, joint: str) -> ToolLoad:
        """Return what is believed to be behind a sensor.

        Args:
            joint: Fixed joint of the model with the sensor in it; empty for that at the flange.

        Raises:
            InputError: If the model has no such joint, or no tool behind it.
        """

    def hang(self, context: Context, joint: str, mass: float) -> None:
        """Let more hang below a force sensor than is believed, where the load's centre is.

        Args:
            context: Context of the plant.
            joint: Fixed joint of the model with the sensor in it; empty for that at the flange.
            mass: [kg].

        Raises:
            InputError: If the plant's masses cannot be changed once it is made.
        """
        del context, joint, mass
        raise InputError("masses of this robot's plant cannot be changed once it is made")

    @abstractmethod
    def check_belief(self, source: BeliefSource, sensor_joint: str | None) -> None:
        """Refuse what no controller could believe of this robot; nothing is built.

        Args:
            source: Where the belief comes from; of the same robot.
            sensor_joint: The joint with a force sensor in it, or empty for the default one; None
                without a sensor.

        Raises:
            InputError: If what is to be believed makes no robot, or no tool.
        """

    @abstractmethod
    def posture(self, target: ToolTarget, start: StartParameters) -> np.ndarray:
        """Return joint coordinates that put the tool where it starts, shape (N,).

        Args:
            target: Where that is.
            start: What the scenario says of it.

        Raises:
            InputError: If it is out of reach.
        """

    def start_warnings(
        self, start: StartParameters, q_J: np.ndarray, target: ToolTarget
    ) -> list[str]:
        """Return what there is to say about the robot and its start, one sentence each.

        Args:
            start: What the scenario says of the start.
            q_J: Joint coordinates found, shape (N,).
            target: Where the tool starts.
        """
        return []

    @abstractmethod
    def state_at_rest(self, q_J: np.ndarray) -> np.ndarray:
        """Return the state of the model at rest, elastic joints carrying the links' weight.

        Args:
            q_J: Joint coordinates, shape (N,).
        """

    def check_reach(self, position: np.ndarray, where: str) -> None:  # noqa: B027
        """Refuse a position on the way that the robot is known not to reach.

        Args:
            position: Position of the tool point [m], shape (3,).
            where: For the message.

        Raises:
            InputError: If so. Robots that have to be tried say nothing.
        """

    @abstractmethod
    def place(self, context: Context, state: np.ndarray) -> None:
        """Put the plant into a state of its model, ``[q, v]``.

        Args:
            context: Context of the plant.
            state: Shape (num_states,), see :class:`PlantCoordinates`.
        """
