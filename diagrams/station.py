"""What running, logging and measuring need to know of a station."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydrake.systems.framework import Context, Diagram

from diagrams.fault_instant import first_instant
from diagrams.holder_station import Holder
from diagrams.oscillation import oscillation_before
from diagrams.robots.part import RobotPart
from diagrams.robots.workpiece import FurtherLength, Workpiece
from diagrams.signal_log import SignalLog
from diagrams.surroundings.mounting import Mounting
from diagrams.surroundings.operator import Operator
from diagrams.tasks.path_following import PathTask
from diagrams.tasks.task import StartPoint, Task
from diagrams.tasks.waiting import CrossingWait
from diagrams.turntable_station import Turntable
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.drivers.teleoperation_link import TeleoperationEnd
from pfsc_drake.following.fault_description import FaultScene, FoundFault, describe
from pfsc_drake.geometry import Path
from pfsc_drake.robot.robot_model import RobotModel, gravity_function
from pfsc_drake.systems.following_controller import ControllerAccess
from pfsc_drake.systems.fuse import BlockAccess
from pfsc_drake.systems.physics.operator_panel import OperatorPanel
from pfsc_drake.systems.physics.velocity_servo import ServoAccess


@dataclass
class Station:
    """A built station and what is needed to run it.

    Attributes:
        diagram: The diagram.
        part: The robot in it.
        task: What it is to do.
        law: The law.
        projector: Name of the projector.
        controller: The controller in it.
        servo: Its velocity servos, if there are any.
        log: Log of ``joint_state``, ``tool_pose``, ``manifold_point``, ``reference``, ``law``;
            of what acts on the tool ``wrench_ext``, of a sensor what :func:`add_sensor`
            returns, with compliance what :func:`add_compliance` returns, with servos
            ``drive_torque``, with friction ``friction_torque``. With imperfect encoders
            ``joint_state`` is the truth, and the law was given ``joint_state_measured``.
        initial_state: State of the robot's model at the start.
        start: Where the tool is at the start.
        on_motors: Whether the law acts on the tool pose of the motors, not of the links.
        measured: System and port that the measured joint state comes from, by name, as they were
            before blocks were fused.
        warn: Tells what may not go as well as hoped, one sentence each.
        workpiece: What the tool may touch, if anything.
        operator: Who guides the tool while the robot moves, if anybody does.
        mode_labels: What the values of a logged signal ``mode`` are called, if there is one.
        mounting: Where plates come from and go, if there are any.
        ticks_late: After how many ticks torques act that are told.
        holder: The robot that holds the workpiece which the path is on, if one does.
        pen: Where way points enter that a person draws, if one does.
        waiting: How progress waits for obstacles, if it does.
        leader: Link to who leads the tool in another process, if somebody does.
        turntable: The turntable that carries the workpiece which the path is on, if one does.
    """

    diagram: Diagram
    part: RobotPart
    task: Task
    law: FollowingLaw
    projector: str
    controller: ControllerAccess
    servo: ServoAccess | None
    log: SignalLog
    initial_state: np.ndarray
    start: StartPoint
    on_motors: bool
    measured: tuple[str, str]
    warn: Callable[[], list[str]]
    workpiece: Workpiece | None = None
    operator: Operator | None = None
    mode_labels: Sequence[str] = ()
    mounting: Mounting | None = None
    ticks_late: int = 0
    holder: Holder | None = None
    pen: OperatorPanel | None = None
    waiting: CrossingWait | None = None
    leader: TeleoperationEnd | None = None
    turntable: Turntable | None = None

    @property
    def robot(self) -> RobotModel:
        """The robot as it is."""
        return self.part.robot

    @property
    def initial_place(self) -> np.ndarray:
        """Place on the manifold at the start, as the projector remembers it."""
        return self.start.place

    @cached_property
    def warnings(self) -> list[str]:
        """What may not go as well as hoped, one sentence each."""
        return self.warn()

    @cached_property
    def blocks(self) -> BlockAccess:
        """What the diagram's blocks remember and put out, fused or not."""
        return BlockAccess(self.diagram)

    @property
    def path(self) -> Path:
        """The path, of a station whose task is one."""
        assert isinstance(self.task, PathTask)
        return self.task.path

    @property
    def start_posture(self) -> np.ndarray:
        """Joint coordinates at the start [rad or m], shape (N,)."""
        return (self.part.coordinates.link_rows @ self.initial_state)[: self.robot.dimension]

    @property
    def reference_duration(self) -> float:
        """Length of the reference motion [s]."""
        return self.task.motion.domain[1]

    def set_start(self, root: Context) -> None:
        """Put the robot at the start of the scenario, where its drives hold its weight.

        A discrete plant's first step is one of what the drives did before the first tick, and so
        are those of drives that act late: without this the robot would fall for as long.

        Args:
            root: Context of the diagram.
        """
        self.place_robot(root, self.initial_state)
        late = self.ticks_late
        if late or self.part.drives.step is not None:
            weight = gravity_function(self.part.robot)(self.start_posture).full().ravel()
            self.blocks.set_state(root, "hold.held", np.tile(weight, 1 + late))
        if self.holder is not None:
            self.holder.set_start(self.blocks, root)
        self.set_place(root, self.initial_place)

    def tell_way_points(self, root: Context, message: np.ndarray) -> None:
        """Set what the station hears from the next tick on of way points that a person draws.

        Args:
            root: Context of the diagram.
            message: Laid out as the task's path says.
        """
        assert self.pen is not None
        context = self.pen.GetMyMutableContextFromRoot(root)
        self.pen.GetInputPort("controls").FixValue(context, message)

    def set_place(self, root: Context, place: np.ndarray) -> None:
        """Choose where on the manifold, on which branch of it, the tool is.

        Args:
            root: Context of the diagram.
            place: As the projector remembers it.
        """
        self.blocks.set_state(root, f"{self.projector}.place", place)

    def place_robot(self, root: Context, state: np.ndarray) -> None:
        """Put the robot into a state.

        Args:
            root: Context of the diagram.
            state: ``[q, v]`` of its model, see :class:`PlantCoordinates`.
        """
        self.part.place(self.part.plant.GetMyMutableContextFromRoot(root), state)

    def fault(self, root: Context) -> str | None:
        """Return why a system of the station is in its safe state, and where it came to be.

        None if none is.

        Args:
            root: Context of the diagram.
        """
        found = self.found_fault(root)
        return None if found is None else found.sentence

    def found_fault(self, root: Context) -> FoundFault | None:
        """Return why a system of the station is in its safe state, and since when, if one is.

        The controller, which is told of the others' faults, comes first.

        Args:
            root: Context of the diagram.
        """
        fault = self.controller.fault(self.blocks, root)
        if fault is Fault.STOP_REQUESTED and self.holder is not None:
            return self.holder.found_fault(self.log, self.blocks, root)
        if fault is not Fault.NONE:
            suspects = self.controller.suspects(self.blocks, root)
            return self._describe(fault, root, "law", self.law.layout.status.start, suspects)
        servo = self.servo
        if servo is None or (fault := servo.fault(self.blocks, root)) is Fault.NONE:
            return None
        suspects = servo.suspects(self.blocks, root)
        found = self._describe(fault, root, "servo_fault", 0, suspects)
        return FoundFault(f"{servo.name}: {found.sentence}", found.time)

    def _describe(
        self, fault: Fault, root: Context, signal: str, column: int, suspects: np.ndarray
    ) -> FoundFault:
        """Return what there is to say of a fault that is logged in a column of a signal."""
        now, before = first_instant(self.log, self.blocks, root, signal, column)
        place, robot = self.task.place, self.part.belief.robot
        oscillating = oscillation_before(now.time, self.log, root, self.law)
        scene = FaultScene(
            self.law, robot, place, self.on_motors, now, before, suspects, oscillating
        )
        return FoundFault(describe(fault, scene), now.time)

    def mode_name(self, mode: int) -> str:
        """Return what a value of the signal ``mode`` is called.

        Args:
            mode: The value.
        """
        return self.mode_labels[mode] if 0 <= mode < len(self.mode_labels) else str(mode)

    def further_lengths(self, y_t: np.ndarray) -> dict[str, FurtherLength]:
        """Return what else is worth a look in a run, by name, if anything is.

        Args:
            y_t: Motion of the tool point [m], shape (samples, 3).
        """
        if self.workpiece is None:
            return {}
        return self.workpiece.lengths(y_t, self.initial_place, self.part.gravity)
