"""A robot with its controller in a diagram."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort

from diagrams.oscillation import oscillation_before
from diagrams.robots.joint_state import add_joint_state, add_torque_sensor, check_sides
from diagrams.robots.nominal_model import nominal_robot
from diagrams.robots.part import RobotPart
from diagrams.robots.plant_friction import nominal_friction
from diagrams.robots.remote_arm import RemoteArm
from diagrams.scenario import Scenario
from diagrams.signal_log import SignalLog
from diagrams.station_options import StationOptions
from diagrams.station_warnings import controller_warnings
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.controller.controller import Controller
from pfsc_drake.controller.fault_description import FaultReport
from pfsc_drake.controller.options.follower_options import FollowerOptions
from pfsc_drake.controller.tasks.task import StartPoint, Task
from pfsc_drake.errors import InputError
from pfsc_drake.physics.joint_sensors import EncoderOptions
from pfsc_drake.systems.following_controller import ControllerAccess
from pfsc_drake.systems.fuse import BlockAccess

_NAME = "controller"


@dataclass
class ControlledRobot:
    """A robot with its controller.

    Attributes:
        scenario: Its scenario.
        part: The robot.
        controller: Its controller.
        start: Start of its tool.
        initial_state: State of its model at the start.
        true_state: Actual ``[q_J, v_J, q_M, v_M]``.
        measured: Measured ``[q_J, v_J, q_M, v_M]``.
    """

    scenario: Scenario
    part: RobotPart
    controller: Controller
    start: StartPoint
    initial_state: np.ndarray
    true_state: OutputPort
    measured: OutputPort

    @property
    def task(self) -> Task:
        """Task of its tool."""
        return self.controller.task

    @property
    def initial_conditions(self) -> tuple[StartPoint, np.ndarray]:
        """Start of the tool, and state of the robot's model there."""
        return self.start, self.initial_state

    @property
    def signals(self) -> dict[str, OutputPort]:
        """Outputs of the controller by name, and the commands to the drives as ``drive``."""
        ports = [
            self.controller.get_output_port(i) for i in range(self.controller.num_output_ports())
        ]
        named = {port.get_name(): port for port in ports}
        return named | {"drive": named[self.controller.drive_port]}

    @property
    def logged_states(self) -> dict[str, OutputPort]:
        """Signal ``joint_state``, and ``joint_state_measured`` if the law receives another one."""
        own, actual = self.signals["joint_state"], self.true_state
        if isinstance(self.part, RemoteArm):  # nothing else is known of the links' side
            actual = self.signals["found_state"]
        states = {"joint_state": actual}
        if self.measured is self.true_state and not self.controller.estimates_state:
            return states
        return states | {"joint_state_measured": own}

    @property
    def start_posture(self) -> np.ndarray:
        """Joint coordinates at the start [rad or m], shape (N,)."""
        return self.controller.start_posture

    @cached_property
    def access(self) -> ControllerAccess:
        """Faults and commands of the controller, its blocks fused or not."""
        return self.controller.access

    def set_start(self, blocks: BlockAccess, root: Context) -> None:
        """Set the start of robot and projector.

        Args:
            blocks: Blocks of the diagram.
            root: Context of the diagram.
        """
        self.part.set_state(self.part.plant.GetMyMutableContextFromRoot(root), self.initial_state)
        self.set_projection(blocks, root, self.start.projection)

    def set_projection(self, blocks: BlockAccess, root: Context, projection: np.ndarray) -> None:
        """Set the projection of the tool onto the manifold, which selects the branch.

        Args:
            blocks: Blocks of the diagram.
            root: Context of the diagram.
            projection: State of the projector.
        """
        name = self.controller.get_name()
        blocks.set_state(root, f"{name}.{self.task.projector_name}.projection", projection)

    def found_fault(self, log: SignalLog, blocks: BlockAccess, root: Context) -> FaultReport | None:
        """Return the cause of a stop by the controller, or None.

        Args:
            log: Log of its signals.
            blocks: Blocks of the diagram.
            root: Context of the diagram.
        """
        fault = self.access.fault(blocks, root)
        if fault is Fault.NONE:
            return None
        column = self.controller.law.layout.status.start
        return self.describe(fault, log, blocks, root, "law", column)

    def describe(
        self,
        fault: Fault,
        log: SignalLog,
        blocks: BlockAccess,
        root: Context,
        signal: str,
        column: int,
        suspects: np.ndarray | None = None,
    ) -> FaultReport:
        """Return a sentence on a fault, and its time.

        Args:
            fault: The fault.
            log: Log of its signals.
            blocks: Blocks of the diagram.
            root: Context of the diagram.
            signal: Logged signal with the fault.
            column: Its column.
            suspects: Implausible components of the joint state; by default the controller's.
        """
        now, before = log.first_instant(blocks, root, signal, column)
        if suspects is None:
            suspects = self.access.suspects(blocks, root)
        oscillating = oscillation_before(now.time, log, root, self.controller.law)
        sentence = self.controller.describe_fault(fault, now, before, suspects, oscillating)
        return FaultReport(sentence, now.time)

    def warnings(self) -> list[str]:
        """Return warnings about the robot and its controller, one sentence each."""
        plan, scenario, controller = self.task.drive_plan, self.scenario, self.controller
        return [
            *self.task.warnings,
            *scenario.model_error.warnings,
            *([] if plan is None else plan.messages),
            *self.part.start_warnings(scenario.start, self.start_posture, self.start.target),
            *controller_warnings(scenario, self.part, controller),
        ]


def add_controlled_robot(
    builder: DiagramBuilder,
    chosen: StationOptions,
    part: RobotPart,
    task: Task,
    start: tuple[StartPoint, np.ndarray],
    options: FollowerOptions,
    *,
    like: ControlledRobot | None = None,
) -> ControlledRobot:
    """Add the controller of a robot, and its encoders.

    Args:
        builder: Builder of the diagram, with the robot.
        chosen: Options of the robot's parts.
        part: The robot.
        task: Task of its tool.
        start: Start of the tool, and state of the robot's model there.
        options: Options of the controller.
        like: Robot that differs in the model or the integration only, if it has been built.

    Raises:
        InputError: If the controller cannot be built.
    """
    nominal, scenario, period = part.nominal_model.robot, chosen.scenario, chosen.period
    remote, parameters = isinstance(part, RemoteArm), scenario.controller
    friction = nominal_friction(part, parameters.friction.nominal, chosen.friction)
    if not remote:
        check_sides(nominal, parameters, scenario.encoders)
    with naming_reference():
        controller = Controller(
            task,
            nominal_robot(nominal, scenario.encoders, period, friction),
            options,
            start[0],
            (part.coordinates.link_rows @ start[1])[: part.robot.dimension],
            duration=scenario.duration,
            progress=chosen.progress,
            like=None if like is None else like.controller,
            logged=True,
        )
    controller.set_name(_NAME)
    true_state = part.joint_state(builder)
    measured = add_joint_state(
        builder,
        true_state,
        part.robot,
        EncoderOptions() if remote else scenario.encoders,
        scenario.simulation.sensor_failure,
        period,
        scenario.encoder_period,
    )
    builder.AddNamedSystem(_NAME, controller)
    controller.connect(builder, "joint_state", measured)
    if controller.HasInputPort("joint_torque"):
        torque = _joint_torque(builder, part, scenario.encoders, period, true_state)
        builder.Connect(torque, controller.GetInputPort("joint_torque"))
    return ControlledRobot(scenario, part, controller, *start, true_state, measured)


def _joint_torque(
    builder: DiagramBuilder,
    part: RobotPart,
    encoders: EncoderOptions,
    period: float,
    true_state: OutputPort,
) -> OutputPort:
    if isinstance(part, RemoteArm):
        return part.torque.get_output_port()
    return add_torque_sensor(builder, part.robot, encoders, period, true_state)


@contextmanager
def naming_reference() -> Iterator[None]:
    """Name the block of a scenario in errors about its oscillations."""
    try:
        yield
    except InputError as error:
        message = str(error)
        raise InputError(
            f"reference.{message}" if message.startswith("swings") else message
        ) from None
