"""An arm in another process, with sources for its measured signals."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import ConstantVectorSource

from diagrams.robots.arm import Arm
from diagrams.robots.arm_model import nominal_arm, read_arm
from diagrams.robots.nominal_model import NominalModelSource
from diagrams.robots.part import Ports, SensorMount
from pfsc_drake.errors import InputError


@dataclass(frozen=True)
class RemoteArm(Arm):
    """An arm in another process; the diagram has its measured signals only.

    Attributes:
        measured: Measured joint state ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        torque: Measured torques in its joints, shape (N,) [Nm or N].
        stop_request: Request of a stop, nonzero from then on, shape (1,).
        override: Speed scaling of the reference, shape (1,).
        wrench: Wrench at its force sensor, axes of the sensor, shape (6,) [N, Nm].
    """

    measured: ConstantVectorSource
    torque: ConstantVectorSource
    stop_request: ConstantVectorSource
    override: ConstantVectorSource
    wrench: ConstantVectorSource | None = None

    @property
    def plant(self) -> ConstantVectorSource:
        """The system in the diagram that replaces the plant."""
        return self.measured

    def joint_state(self, builder: DiagramBuilder) -> OutputPort:
        """Return the measured ``[q_J, v_J, q_M, v_M]``, shape (4N,)."""
        return self.measured.get_output_port()

    def connect_drives(self, builder: DiagramBuilder, torque: OutputPort) -> None:
        """Leave the drives to the robot."""

    def connect_resistance(self, builder: DiagramBuilder, resistance: OutputPort) -> None:
        """Leave friction to the robot."""

    def _apply(self, builder: DiagramBuilder, forces: Sequence[LeafSystem]) -> None:
        raise InputError("forces on a robot in another process cannot be simulated here")

    def set_state(self, context: Context, state: np.ndarray) -> None:
        """Set the measured joint state to a state of the model, ``[q, v]``."""
        self.measured.get_mutable_source_value(context).SetFromVector(self.coordinates.rows @ state)

    def set_measurement(self, root: Context, joint_state: np.ndarray, torque: np.ndarray) -> None:
        """Set the measured state and torques of the joints.

        Args:
            root: Context of the diagram.
            joint_state: ``[q_J, v_J, q_M, v_M]``, shape (4N,).
            torque: Torques in the joints, with those of the weight, shape (N,) [Nm or N].
        """
        for source, values in ((self.measured, joint_state), (self.torque, torque)):
            context = source.GetMyMutableContextFromRoot(root)
            source.get_mutable_source_value(context).SetFromVector(values)

    def set_override(self, root: Context, share: float) -> None:
        """Set the speed scaling of the reference.

        Args:
            root: Context of the diagram.
            share: Share of the planned speed, 0 to 1.5; 0 is a pause.
        """
        context = self.override.GetMyMutableContextFromRoot(root)
        self.override.get_mutable_source_value(context).SetAtIndex(0, share)

    def request_stop(self, root: Context) -> None:
        """Request that the controller stops the robot.

        Args:
            root: Context of the diagram.
        """
        context = self.stop_request.GetMyMutableContextFromRoot(root)
        self.stop_request.get_mutable_source_value(context).SetAtIndex(0, 1.0)

    def sensor_mount(self, builder: DiagramBuilder, joint: str, ports: Ports) -> SensorMount:
        """Return the mount of its force/torque sensor, with the received reading."""
        assert self.wrench is not None
        load = self.actual.tool_load(joint)
        return SensorMount(
            load, self.nominal_load(joint), None, reading=self.wrench.get_output_port()
        )


def add_remote_arm(
    builder: DiagramBuilder, source: NominalModelSource, *, has_sensor: bool
) -> RemoteArm:
    """Add an arm in another process.

    Args:
        builder: Builder of the diagram.
        source: The arm, and the source of its nominal model.
        has_sensor: Whether forces are measured at its flange.

    Raises:
        InputError: If the model cannot be read, is no chain of joints, or the nominal model is
            invalid.
    """
    actual = read_arm(source.robot, source.folder)

    def constant(name: str, size: int) -> ConstantVectorSource:
        return builder.AddNamedSystem(name, ConstantVectorSource(np.zeros(size)))

    measured = constant("robot", 4 * actual.chain.dimension)
    torque, stop = constant("joint_torques", actual.chain.dimension), constant("stop_request", 1)
    override = builder.AddNamedSystem("override", ConstantVectorSource(np.ones(1)))
    wrench = constant("force_torque_sensor", 6) if has_sensor else None
    return RemoteArm(actual, *nominal_arm(actual, source), measured, torque, stop, override, wrench)
