"""A station while it is built: its systems, and their signals by name."""

from dataclasses import dataclass, field

from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.controlled_robot import ControlledRobot
from diagrams.environment.acting_forces import Environment
from diagrams.environment.operator import Operator
from diagrams.holder_station import Holder
from diagrams.scenario import Scenario
from diagrams.station_options import StationOptions
from diagrams.turntable_station import Turntable
from pfsc_drake.blocks.block import Block
from pfsc_drake.controller.controller import Controller
from pfsc_drake.controller.tasks.task import Task
from pfsc_drake.drivers.teleoperation_link import TeleoperationEndpoint
from pfsc_drake.errors import InputError
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.physics.operator_panel import OperatorPanel
from pfsc_drake.systems.physics.velocity_servo import ServoAccess

# signals of the station that are inputs of its controllers under other names
_OTHERWISE = {
    "obstacles": "obstacles_measured",
    "measured_wrench": "wrench_sensor",
    "message": "message_arrived",
    "tool_wrench": "wrench_measured",
    "tool_pose": "world_pose",
}


@dataclass
class Site:
    """A station while it is built.

    Attributes:
        builder: Builder of the diagram.
        options: Options of its parts.
        robot: The robot with its controller.
        around: All that acts on the robot.
        remote: Whether the robot is in another process.
        carrier: Robot or turntable that carries the workpiece, if there is one.
        signals: Signals by name: ``true_state``, ``measured_state``, all outputs of the controller,
            and those of the other parts.
        logged: Signals for the log.
        operator: A person who guides the tool, if one does.
        pen: Input of waypoints that a person draws, if one does.
        leader: Link to a leader in another process, if there is one.
        servo: Velocity servos, if there are any.
    """

    builder: DiagramBuilder
    options: StationOptions
    robot: ControlledRobot
    around: Environment
    remote: bool = False
    carrier: Holder | Turntable | None = None
    signals: dict[str, OutputPort] = field(default_factory=dict)
    logged: dict[str, OutputPort] = field(default_factory=dict)
    operator: Operator | None = None
    pen: OperatorPanel | None = None
    leader: TeleoperationEndpoint | None = None
    servo: ServoAccess | None = None

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        return self.options.scenario

    @property
    def task(self) -> Task:
        """Task of the tool."""
        return self.robot.task

    @property
    def period(self) -> float:
        """Sampling time of the controller [s]."""
        return self.robot.controller.period

    @property
    def controllers(self) -> list[Controller]:
        """Controllers of the robot and, if there is one, of the workpiece robot."""
        others = [self.carrier.robot] if isinstance(self.carrier, Holder) else []
        return [robot.controller for robot in (self.robot, *others)]

    def add(self, name: str, block: Block, **sources: OutputPort) -> BlockSystem:
        """Add a block that is sampled with the controller, and return its system.

        Args:
            name: Name of the system.
            block: The block.
            sources: Sources of its inputs by name; other inputs stay open.
        """
        system = self.builder.AddNamedSystem(name, BlockSystem(block, self.period))
        for port, source in sources.items():
            self.builder.Connect(source, system.GetInputPort(port))
        return system

    def show(self, **signals: OutputPort) -> None:
        """Add signals, also to the log.

        Args:
            signals: Signals by name.
        """
        self.signals |= signals
        self.logged |= signals

    def connect(self) -> None:
        """Connect the open inputs of all controllers with the signals of their names.

        Raises:
            InputError: If there is no signal for an input that is not optional.
        """
        for controller in self.controllers:
            for port in map(controller.get_input_port, range(controller.num_input_ports())):
                if self.builder.IsConnectedOrExported(port):
                    continue
                name = port.get_name()
                source = self.signals.get(_OTHERWISE.get(name, name))
                if source is None:
                    raise InputError(
                        f"{controller.get_name()}: input {name} is not connected; the station has "
                        f"no signal {_OTHERWISE.get(name, name)}: {', '.join(sorted(self.signals))}"
                    )
                self.builder.Connect(source, port)
