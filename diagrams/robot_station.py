"""A robot with its friction, sensors and environment, without a controller."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as FilePath

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, OutputPort
from pydrake.systems.primitives import ConstantVectorSource

from diagrams.environment.acting_forces import Environment
from diagrams.robots.drives import add_drives
from diagrams.robots.force_sensor import add_force_sensor
from diagrams.robots.joint_state import add_joint_state, add_torque_sensor
from diagrams.robots.model import is_delta
from diagrams.robots.part import RobotPart
from diagrams.robots.plant_friction import add_friction
from diagrams.scenario import DriverParameters, Scenario, Streamed
from diagrams.scenario_task import check_joints, make_task
from diagrams.station_options import StationOptions
from diagrams.station_start import find_start
from pfsc_drake.checks import require
from pfsc_drake.control.manifolds.manifold import ToolKinematics
from pfsc_drake.controller.assembly import acts_on_motors
from pfsc_drake.controller.nominal_robot import NominalRobot
from pfsc_drake.drivers.messages import ControlMode
from pfsc_drake.robot.robot_model import gravity_function
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.fuse import BlockAccess, fuse_blocks


@dataclass
class RobotStation:
    """A robot that waits for commands.

    Attributes:
        diagram: The diagram.
        part: The robot in it.
        command: Commands to its drives: torques, or velocities of its servos.
        mode: Kind of the commands.
        measured: System and port of the measured joint state, by name.
        torque: System and port of the torques in its elastic joints, None for a rigid robot.
        wrench: System and port of the wrench at the force sensor, None without one.
        initial_state: State of the robot's model at the start.
        projection: State of the projector at the start.
        projector: Name of the projector.
        ticks_late: Number of ticks after which torques act.
    """

    diagram: Diagram
    part: RobotPart
    command: ConstantVectorSource
    mode: ControlMode
    measured: tuple[str, str]
    torque: tuple[str, str] | None
    wrench: tuple[str, str] | None
    initial_state: np.ndarray
    projection: np.ndarray
    projector: str
    ticks_late: int = 0

    @cached_property
    def blocks(self) -> BlockAccess:
        """States and outputs of the diagram's blocks, fused or not."""
        return BlockAccess(self.diagram)

    def set_start(self, root: Context) -> None:
        """Set the start of the scenario, with drive torques that hold the robot's weight.

        Args:
            root: Context of the diagram.
        """
        self.part.set_state(self.part.plant.GetMyMutableContextFromRoot(root), self.initial_state)
        self.blocks.set_state(root, f"{self.projector}.projection", self.projection)
        n = self.part.robot.dimension
        if self.mode is ControlMode.TORQUE:
            q = (self.part.coordinates.link_rows @ self.initial_state)[:n]
            weight = gravity_function(self.part.robot)(q).full().ravel()
            self.set_command(root, weight)
            self.blocks.set_state(root, "hold.held", np.tile(weight, 1 + self.ticks_late))

    def set_command(self, root: Context, values: np.ndarray) -> None:
        """Set the commands to the drives.

        Args:
            root: Context of the diagram.
            values: Torques [Nm or N] or velocities [rad/s or m/s], shape (N,).
        """
        context = self.command.GetMyMutableContextFromRoot(root)
        self.command.get_mutable_source_value(context).SetFromVector(values)

    def joint_state(self, root: Context) -> np.ndarray:
        """Return ``[q_J, v_J, q_M, v_M]`` as measured, shape (4N,).

        Args:
            root: Context of the diagram.
        """
        return self._read(root, self.measured)

    def joint_torque(self, root: Context) -> np.ndarray:
        """Return the torques in elastic joints as measured, zero in rigid ones, shape (N,).

        Args:
            root: Context of the diagram.
        """
        if self.torque is None:
            return np.zeros(self.part.robot.dimension)
        return self._read(root, self.torque)

    def measured_wrench(self, root: Context) -> np.ndarray | None:
        """Return the wrench at the force sensor, shape (6,) [N, Nm], None without one.

        Args:
            root: Context of the diagram.
        """
        return None if self.wrench is None else self._read(root, self.wrench)

    def _read(self, root: Context, source: tuple[str, str]) -> np.ndarray:
        """Return the value of an output of a block, or of another system of the diagram."""
        name, port = source
        if not self.diagram.HasSubsystemNamed(name):
            return self.blocks.output(root, f"{name}.{port}")
        system = self.diagram.GetSubsystemByName(name)
        value: np.ndarray = system.GetOutputPort(port).Eval(system.GetMyContextFromRoot(root))
        return value


def build_robot_station(scenario: Scenario, folder: FilePath) -> RobotStation:
    """Build the robot of a scenario and its environment, without a controller.

    Args:
        scenario: The scenario.
        folder: Base folder of relative file names.

    Raises:
        InputError: If the scenario cannot be built, or needs a controller beside the robot.
    """
    for key in ("plate", "operator", "holder", "turntable"):
        absent = getattr(scenario, key) is None
        require(absent, key, "given", "null where the controller is elsewhere")
    model = scenario.robot.model
    require(not is_delta(model), "robot.model", model, "an arm, where the controller is elsewhere")
    known = not isinstance(scenario.path.shape, Streamed)
    beforehand = "a path that is known beforehand, where the controller is elsewhere"
    require(known, "path.shape", "!Streamed", beforehand)
    builder, chosen = DiagramBuilder(), StationOptions(scenario, folder)
    period = chosen.period
    task = make_task(scenario, folder)
    workpiece = chosen.workpiece(task)
    part = chosen.add_robot(builder, workpiece)
    n = part.robot.dimension
    check_joints(scenario, task, n)
    start, initial_state = find_start(scenario.start, task, part, workpiece)
    true_state = part.joint_state(builder)
    joint_state = add_joint_state(
        builder,
        true_state,
        part.robot,
        scenario.encoders,
        scenario.simulation.sensor_failure,
        period,
        scenario.encoder_period,
    )
    # by the actual pose of the tool, not by that of the nominal model
    on_motors = acts_on_motors(scenario.controller.law, NominalRobot(part.robot))
    tool = BlockSystem(ToolKinematics(part.robot, on_motors), period)
    builder.AddNamedSystem("tool_kinematics", tool)
    builder.Connect(true_state, tool.GetInputPort("joint_state"))
    projector = BlockSystem(task.projection_block, period)
    builder.AddNamedSystem(task.projector_name, projector)
    builder.Connect(tool.GetOutputPort("tool_pose"), projector.GetInputPort("tool_pose"))
    around = Environment(part, task, task.manifold, chosen.outside, start)
    point = projector.GetOutputPort("manifold_point")
    forces = around.add(builder, {"true_state": true_state, "manifold_point": point})
    torque = wrench = None
    if not part.robot.is_rigid:
        torque = _name(
            add_torque_sensor(builder, part.robot, scenario.encoders, period, true_state)
        )
    if scenario.needs_sensor:
        ports = {"true_joint_state": true_state} | forces
        failure = scenario.simulation.force_sensor_failure
        wrench = _name(add_force_sensor(builder, part, scenario.sensor, failure, period, ports))
    command = builder.AddNamedSystem("command", ConstantVectorSource(np.zeros(n)))
    # the link is the first tick of the delay; the low pass is part of the driver
    late = max(scenario.driver.ticks(period) - 1, 0)
    beyond_the_link = DriverParameters(delay=late * period)
    drive = {"drive": command.get_output_port(), "joint_state": joint_state}
    signals, _ = add_drives(
        builder, part, chosen.servo, beyond_the_link, period, drive, initial_state
    )
    stops = [signals["servo_stop_category"]] if "servo_stop_category" in signals else []
    add_friction(builder, part, true_state, chosen.friction, stops)
    measured = _name(joint_state)
    if scenario.simulation.fused:
        fuse_blocks(builder)
    diagram = builder.Build()
    diagram.set_name("robot")
    torques = scenario.controller.law_record.commands_torque
    return RobotStation(
        diagram,
        part,
        command,
        ControlMode.TORQUE if torques else ControlMode.VELOCITY,
        measured,
        torque,
        wrench,
        initial_state,
        start.projection,
        task.projector_name,
        late,
    )


def _name(port: OutputPort) -> tuple[str, str]:
    return port.get_system().get_name(), port.get_name()
