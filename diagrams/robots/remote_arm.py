"""An arm that stands elsewhere: what it measures comes from outside, what drives it goes there."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import ConstantVectorSource

from diagrams.robots.arm import Arm
from diagrams.robots.arm_model import believe_arm, read_arm
from diagrams.robots.belief import BeliefSource
from diagrams.robots.part import Ports, SensorMount
from pfsc_drake.errors import InputError


@dataclass(frozen=True)
class RemoteArm(Arm):
    """An arm of which a diagram has nothing but what it measures.

    Attributes:
        measured: What it measures of its joints, ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        torque: What it measures of the torques in its joints, shape (N,) [Nm or N].
        stop_request: Nonzero from when on the controller is to stop it, shape (1,).
        override: Share of its planned pace at which the reference moves, shape (1,).
        wrench: What its force sensor measures, the sensor's axes, shape (6,) [N, Nm].
    """

    measured: ConstantVectorSource
    torque: ConstantVectorSource
    stop_request: ConstantVectorSource
    override: ConstantVectorSource
    wrench: ConstantVectorSource | None = None

    @property
    def plant(self) -> ConstantVectorSource:
        """The system in the diagram that stands for it."""
        return self.measured

    def joint_state(self, builder: DiagramBuilder) -> OutputPort:
        """Return ``[q_J, v_J, q_M, v_M]`` as measured, shape (4N,)."""
        return self.measured.get_output_port()

    def connect_drives(self, builder: DiagramBuilder, torque: OutputPort) -> None:
        """Leave the drives to the robot."""

    def connect_resistance(self, builder: DiagramBuilder, resistance: OutputPort) -> None:
        """Leave friction to the robot."""

    def _apply(self, builder: DiagramBuilder, forces: Sequence[LeafSystem]) -> None:
        raise InputError("what acts on a robot that stands elsewhere acts there")

    def place(self, context: Context, state: np.ndarray) -> None:
        """Let the robot have measured a state of its model, ``[q, v]``."""
        self.measured.get_mutable_source_value(context).SetFromVector(self.coordinates.rows @ state)

    def tell(self, root: Context, joint_state: np.ndarray, torque: np.ndarray) -> None:
        """Let the robot have measured its joints.

        Args:
            root: Context of the diagram.
            joint_state: ``[q_J, v_J, q_M, v_M]``, shape (4N,).
            torque: Torques in the joints, the weight among them, shape (N,) [Nm or N].
        """
        for source, values in ((self.measured, joint_state), (self.torque, torque)):
            context = source.GetMyMutableContextFromRoot(root)
            source.get_mutable_source_value(context).SetFromVector(values)

    def set_override(self, root: Context, share: float) -> None:
        """Let the reference move at another pace.

        Args:
            root: Context of the diagram.
            share: Of the planned pace, 0 to 1.5; 0 is a pause.
        """
        context = self.override.GetMyMutableContextFromRoot(root)
        self.override.get_mutable_source_value(context).SetAtIndex(0, share)

    def request_stop(self, root: Context) -> None:
        """Let the controller bring the robot to rest.

        Args:
            root: Context of the diagram.
        """
        context = self.stop_request.GetMyMutableContextFromRoot(root)
        self.stop_request.get_mutable_source_value(context).SetAtIndex(0, 1.0)

    def sensor_mount(self, builder: DiagramBuilder, joint: str, ports: Ports) -> SensorMount:
        """Return where its force/torque sensor sits, with what that measures as it came."""
        assert self.wrench is not None
        load = self.true.tool_load(joint)
        return SensorMount(
            load, self.believed_load(joint), None, reading=self.wrench.get_output_port()
        )


def add_remote_arm(builder: DiagramBuilder, source: BeliefSource, *, has_sensor: bool) -> RemoteArm:
    """Add an arm that stands elsewhere.

    Args:
        builder: Builder of the diagram.
        source: Which arm, and where what is believed of it comes from.
        has_sensor: Whether forces are measured at its flange.

    Raises:
        InputError: If the model cannot be read, is no chain of joints, or what is to be believed
            of it makes no arm.
    """
    true = read_arm(source.robot, source.folder)

    def constant(name: str, size: int) -> ConstantVectorSource:
        return builder.AddNamedSystem(name, ConstantVectorSource(np.zeros(size)))

    measured = constant("robot", 4 * true.chain.dimension)
    torque, stop = constant("joint_torques", true.chain.dimension), constant("stop_request", 1)
    override = builder.AddNamedSystem("override", ConstantVectorSource(np.ones(1)))
    wrench = constant("force_torque_sensor", 6) if has_sensor else None
    return RemoteArm(true, *believe_arm(true, source), measured, torque, stop, override, wrench)
