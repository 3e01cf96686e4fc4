"""A serial arm in a diagram, whichever model moves it."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import MatrixGain

from diagrams.robots.model import read_robot, tool_frame
from diagrams.robots.plant_wiring import (
    add_external_wrench,
    connect_actuation,
    connect_push,
    connect_resistance,
)
from diagrams.scenario import RobotParameters
from pfsc_drake.errors import InputError
from pfsc_drake.robot.models.parameters import load_parameters
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.chain_from_plant import PlantCoordinates, chain_from_plant
from pfsc_drake.robot.serial.rotor_coupling import mounts_from_parameters
from pfsc_drake.systems.physics.full_elastic_plant import FullElasticPlant


@dataclass(frozen=True)
class Arm(ABC):
    """A serial arm in a diagram: where its signals come from and where they go.

    Attributes:
        model: The arm as Drake knows it, finalized; bodies, frames and joints by name.
        chain: The arm as the laws know it, N joints.
        coordinates: Where its coordinates stand in the state of ``model``.
        tool: Frame whose origin follows the path.
        warnings: What there is to say about the model, one sentence each.
    """

    model: MultibodyPlant
    chain: SerialChain
    coordinates: PlantCoordinates
    tool: Frame
    warnings: list[str]

    @property
    @abstractmethod
    def plant(self) -> LeafSystem:
        """The system in the diagram that moves."""

    @abstractmethod
    def joint_state(self, builder: DiagramBuilder) -> OutputPort:
        """Return the true ``[q_J, v_J, q_M, v_M]``, shape (4N,)."""

    @abstractmethod
    def connect_drives(self, builder: DiagramBuilder, torque: OutputPort) -> None:
        """Let drive torques ``tau_d`` act, shape (N,)."""

    @abstractmethod
    def connect_friction(self, builder: DiagramBuilder, resistance: OutputPort) -> None:
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
    def place(self, context: Context, state: np.ndarray) -> None:
        """Put the plant into a state of ``model``, ``[q, v]``.

        Args:
            context: Context of the plant.
            state: Shape (num_states,), see :class:`PlantCoordinates`.
        """

    @abstractmethod
    def require_reaction_forces(self) -> None:
        """Refuse a force/torque sensor if the plant does not know what its joints carry.

        Raises:
            InputError: If so.
        """


class MultibodyArm(Arm):
    """An arm that Drake's MultibodyPlant moves: (2.42) rigid, (2.65) elastic."""

    @property
    def plant(self) -> MultibodyPlant:
        """See :class:`Arm`."""
        return self.model

    def joint_state(self, builder: DiagramBuilder) -> OutputPort:
        """See :class:`Arm`."""
        return joint_state_of(builder, self.model.get_state_output_port(), self.coordinates)

    def connect_drives(self, builder: DiagramBuilder, torque: OutputPort) -> None:
        """See :class:`Arm`."""
        connect_actuation(builder, self.model, self.coordinates.actuators, torque)

    def connect_friction(self, builder: DiagramBuilder, resistance: OutputPort) -> None:
        """See :class:`Arm`."""
        rows = self.coordinates.motor_rows[self.chain.dimension :]
        connect_resistance(builder, self.model, rows, resistance)

    def connect_wrench(
        self, builder: DiagramBuilder, wrench: OutputPort, joint_state: OutputPort
    ) -> None:
        """See :class:`Arm`."""
        push = add_external_wrench(builder, self.tool, self.chain, wrench, joint_state)
        connect_push(builder, self.model, push)

    def place(self, context: Context, state: np.ndarray) -> None:
        """See :class:`Arm`."""
        self.model.SetPositionsAndVelocities(context, state)

    def require_reaction_forces(self) -> None:
        """See :class:`Arm`."""


@dataclass(frozen=True)
class CoupledArm(Arm):
    """An elastic arm whose rotors couple with the links by their spin: (2.64).

    Attributes:
        full: The plant.
    """

    full: FullElasticPlant

    @property
    def plant(self) -> FullElasticPlant:
        """See :class:`Arm`."""
        return self.full

    def joint_state(self, builder: DiagramBuilder) -> OutputPort:
        """See :class:`Arm`."""
        return self.full.GetOutputPort("joint_state")

    def connect_drives(self, builder: DiagramBuilder, torque: OutputPort) -> None:
        """See :class:`Arm`."""
        builder.Connect(torque, self.full.GetInputPort("drive_torque"))

    def connect_friction(self, builder: DiagramBuilder, resistance: OutputPort) -> None:
        """See :class:`Arm`."""
        builder.Connect(resistance, self.full.GetInputPort("resistance"))

    def connect_wrench(
        self, builder: DiagramBuilder, wrench: OutputPort, joint_state: OutputPort
    ) -> None:
        """See :class:`Arm`."""
        push = add_external_wrench(builder, self.tool, self.chain, wrench, joint_state)
        builder.Connect(push.GetOutputPort("tau_ext"), self.full.GetInputPort("external_torque"))

    def place(self, context: Context, state: np.ndarray) -> None:
        """See :class:`Arm`."""
        rows = np.vstack([self.coordinates.link_rows, self.coordinates.motor_rows])
        self.full.set_joint_state(context, rows @ state)

    def require_reaction_forces(self) -> None:
        """See :class:`Arm`."""
        raise InputError(
            "robot.rotor_coupling: the full model has no force/torque sensor; allowed with "
            "compliance or measured forces: none"
        )


def add_arm(builder: DiagramBuilder, parameters: RobotParameters, folder: FilePath) -> Arm:
    """Add the plant of a serial arm, continuous and without geometry.

    Args:
        builder: Builder of the diagram.
        parameters: Which robot.
        folder: Where relative file names start.

    Raises:
        InputError: If the model cannot be read, is no chain of joints, or its rotors are not
            known.
    """
    coupled = parameters.rotor_coupling
    model, warnings = read_robot(parameters, folder)
    tool = tool_frame(model, parameters)
    chain, coordinates = chain_from_plant(model, tool)
    if not coupled:
        builder.AddNamedSystem("plant", model)
        return MultibodyArm(model, chain, coordinates, tool, warnings)
    try:
        robot = load_parameters(folder / coupled if FilePath(coupled).suffix else coupled)
        plant = FullElasticPlant(chain, mounts_from_parameters(chain, robot))
    except InputError as error:
        raise InputError(f"robot.rotor_coupling: {error}") from None
    builder.AddNamedSystem("plant", plant)
    return CoupledArm(model, chain, coordinates, tool, warnings, plant)


def joint_state_of(
    builder: DiagramBuilder, plant_state: OutputPort, coordinates: PlantCoordinates
) -> OutputPort:
    """Return the true ``[q_J, v_J, q_M, v_M]``, shape (4N,).

    Args:
        builder: Builder of the diagram.
        plant_state: State of the plant.
        coordinates: Where the robot's coordinates stand in it.
    """
    rows = np.vstack([coordinates.link_rows, coordinates.motor_rows])
    encoders = builder.AddNamedSystem("joint_encoders", MatrixGain(rows))
    builder.Connect(plant_state, encoders.get_input_port())
    return encoders.get_output_port()
