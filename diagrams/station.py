"""A built station: diagram, log, robot and task of a run."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from pydrake.systems.framework import Context, Diagram

from diagrams.holder_station import Holder
from diagrams.robots.part import RobotPart
from diagrams.robots.workpiece import FurtherLength, Workpiece
from diagrams.signal_log import SignalLog
from diagrams.site import Site
from diagrams.turntable_station import Turntable
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.controller.fault_description import FaultReport
from pfsc_drake.controller.law_warnings import MODES
from pfsc_drake.controller.tasks.path_task import PathTask
from pfsc_drake.controller.tasks.task import StartPoint, Task
from pfsc_drake.controller.waiting import Waiting
from pfsc_drake.geometry import Path
from pfsc_drake.robot.robot_model import RobotModel, gravity_function
from pfsc_drake.systems.following_controller import ControllerAccess
from pfsc_drake.systems.fuse import BlockAccess


class Station:
    """A built station with access to its parts.

    Args:
        diagram: The diagram.
        site: Its parts.
        log: Log of the signals that its parts show, by their names.
        workpiece: Workpiece that the tool may touch, if there is one.

    Attributes:
        diagram: The diagram.
        controlled: The robot, with its controller.
        log: The log. ``joint_state`` is the actual joint state; ``joint_state_measured`` is the one
            that the law receives, where that differs.
        controllers: Controllers of the robot and, if there is one, of the workpiece robot.
        servo: Velocity servos, if there are any.
        workpiece: Workpiece that the tool may touch, if there is one.
        operator: A person who guides the tool while the robot moves, if one does.
        mode_labels: Names of the values of a logged signal ``mode``, if there is one.
        mounting: Plates that are mounted, if there are any.
        ticks_late: Number of samples after which commanded torques act.
        holder: Robot that holds the workpiece with the path, if there is one.
        turntable: Turntable that carries the workpiece with the path, if there is one.
        crossing: Obstacles, if there are any.
        pen: Input of waypoints that a person draws, if one does.
        leader: Link to a leader in another process, if there is one.
    """

    def __init__(
        self, diagram: Diagram, site: Site, log: SignalLog, workpiece: Workpiece | None
    ) -> None:
        self.diagram, self.controlled, self.log = diagram, site.robot, log
        self.controllers, self.servo = site.controllers, site.servo
        self.workpiece, self.operator, self.mounting = (
            workpiece,
            site.operator,
            site.around.mounting,
        )
        self.mode_labels: Sequence[str] = MODES if "mode" in site.logged else ()
        self.ticks_late = 0 if site.remote else site.scenario.driver.ticks(site.period)
        carrier = site.carrier
        self.holder = carrier if isinstance(carrier, Holder) else None
        self.turntable = carrier if isinstance(carrier, Turntable) else None
        self.crossing, self.pen, self.leader = site.scenario.obstacles, site.pen, site.leader

    @property
    def part(self) -> RobotPart:
        """The robot alone."""
        return self.controlled.part

    @property
    def robot(self) -> RobotModel:
        """Model of the simulated robot."""
        return self.part.robot

    @property
    def task(self) -> Task:
        """Task of the tool."""
        return self.controlled.task

    @property
    def law(self) -> FollowingLaw:
        """Law of the controller."""
        return self.controlled.controller.law

    @property
    def controller(self) -> ControllerAccess:
        """Faults and commands of the controller."""
        return self.controlled.access

    @property
    def waiting(self) -> Waiting | None:
        """Motion that waits for obstacles, if it does."""
        return self.controlled.controller.waiting

    @property
    def initial_state(self) -> np.ndarray:
        """State of the robot's model at the start."""
        return self.controlled.initial_state

    @property
    def start(self) -> StartPoint:
        """Start of the tool."""
        return self.controlled.start

    @property
    def on_motors(self) -> bool:
        """Whether the law acts on the tool pose of the motors, not of the links."""
        return self.controlled.controller.on_motors

    @property
    def initial_projection(self) -> np.ndarray:
        """State of the projector at the start."""
        return self.start.projection

    @cached_property
    def warnings(self) -> list[str]:
        """Warnings about the station, one sentence each."""
        return self.controlled.warnings() + ([] if self.holder is None else self.holder.warnings())

    @cached_property
    def blocks(self) -> BlockAccess:
        """States and outputs of the diagram's blocks, fused or not."""
        return BlockAccess(self.diagram)

    @property
    def path(self) -> Path:
        """The path, of a station whose task is one."""
        assert isinstance(self.task, PathTask)
        return self.task.path

    @property
    def start_posture(self) -> np.ndarray:
        """Joint coordinates at the start [rad or m], shape (N,)."""
        return self.controlled.start_posture

    @property
    def reference_duration(self) -> float:
        """Length of the reference motion [s]."""
        return self.task.end

    def set_start(self, root: Context) -> None:
        """Set the start of the scenario, with drive torques that hold the robot's weight.

        A discrete plant's first step uses the torques from before the first tick, and so do the
        first steps with delayed drives: without these torques the robot would fall meanwhile.

        Args:
            root: Context of the diagram.
        """
        self.controlled.set_start(self.blocks, root)
        late = self.ticks_late
        if late or self.part.drives.step is not None:
            weight = gravity_function(self.part.robot)(self.start_posture).full().ravel()
            self.blocks.set_state(root, "hold.held", np.tile(weight, 1 + late))
        if self.holder is not None:
            self.holder.robot.set_start(self.blocks, root)

    def send_waypoints(self, root: Context, message: np.ndarray) -> None:
        """Set the message with waypoints that a person draws, from the next tick on.

        Args:
            root: Context of the diagram.
            message: Message in the layout of the task's path.
        """
        assert self.pen is not None
        context = self.pen.GetMyMutableContextFromRoot(root)
        self.pen.GetInputPort("controls").FixValue(context, message)

    def set_projection(self, root: Context, projection: np.ndarray) -> None:
        """Set the projection of the tool onto the manifold, which selects the branch.

        Args:
            root: Context of the diagram.
            projection: State of the projector.
        """
        self.controlled.set_projection(self.blocks, root, projection)

    def set_robot_state(self, root: Context, state: np.ndarray) -> None:
        """Set the state of the robot.

        Args:
            root: Context of the diagram.
            state: ``[q, v]`` of its model, see :class:`PlantCoordinates`.
        """
        self.part.set_state(self.part.plant.GetMyMutableContextFromRoot(root), state)

    def fault(self, root: Context) -> str | None:
        """Return the cause for which a system of the station is in its safe state, or None.

        Args:
            root: Context of the diagram.
        """
        found = self.found_fault(root)
        return None if found is None else found.sentence

    def found_fault(self, root: Context) -> FaultReport | None:
        """Return cause and time of the transition of a system to its safe state, or None.

        The controller, which receives the others' faults, comes first.

        Args:
            root: Context of the diagram.
        """
        fault = self.controller.fault(self.blocks, root)
        if fault is Fault.STOP_REQUESTED and self.holder is not None:
            return self.holder.found_fault(self.log, self.blocks, root)
        if fault is not Fault.NONE:
            return self.controlled.found_fault(self.log, self.blocks, root)
        servo = self.servo
        if servo is None or (fault := servo.fault(self.blocks, root)) is Fault.NONE:
            return None
        suspects = servo.suspects(self.blocks, root)
        found = self.controlled.describe(
            fault, self.log, self.blocks, root, "servo_fault", 0, suspects
        )
        return FaultReport(f"{servo.name}: {found.sentence}", found.time)

    def mode_name(self, mode: int) -> str:
        """Return the name of a value of the signal ``mode``.

        Args:
            mode: The value.
        """
        return self.mode_labels[mode] if 0 <= mode < len(self.mode_labels) else str(mode)

    def further_lengths(self, y_t: np.ndarray) -> dict[str, FurtherLength]:
        """Return further lengths of a run, by name.

        Args:
            y_t: Motion of the tool point [m], shape (samples, 3).
        """
        if self.workpiece is None:
            return {}
        return self.workpiece.lengths(y_t, self.initial_projection, self.part.gravity)
