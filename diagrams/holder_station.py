"""The robot of a station that holds the workpiece, with its controller, and what it tells."""

import dataclasses as dc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path as FilePath

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, OutputPort

from diagrams.fault_instant import first_instant
from diagrams.named_builder import PrefixingBuilder
from diagrams.oscillation import oscillation_before
from diagrams.robots.arm import Arm, add_arm
from diagrams.robots.belief import believed_robot
from diagrams.robots.drives import add_drives
from diagrams.robots.friction import add_friction, believed_friction
from diagrams.robots.held_workpiece import holding
from diagrams.robots.joint_state import add_joint_state, add_link_state, states_to_log
from diagrams.robots.model import is_delta
from diagrams.scenario import DriverParameters, HolderParameters, Scenario
from diagrams.scenario.checks import require
from diagrams.scenario.pair import holder_scenario
from diagrams.signal_log import SignalLog
from diagrams.station_parts import (
    belief_source,
    following_options,
    friction_options,
    make_task,
    naming_reference,
)
from diagrams.station_start import find_rest, find_start
from diagrams.station_warnings import controller_warnings
from diagrams.surroundings.held_reaction import HeldReaction, add_held_reaction
from diagrams.tasks.held_frame import HeldFrame
from diagrams.tasks.planned_frame import planned_frame
from diagrams.tasks.task import StartPoint, Task
from pfsc_drake.blocks.wiring_blocks import Hold
from pfsc_drake.control.law.fault import Fault
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.laws import RELATIVE_DEGREE
from pfsc_drake.control.law.timed_reference import TimedReference
from pfsc_drake.control.manifolds.carried import DifferencedFrame, FlangeFrame, PlannedFrame
from pfsc_drake.control.manifolds.moving_frame import POSE_SIZE, frame_size
from pfsc_drake.control.planning.course import CourseStart
from pfsc_drake.errors import InputError
from pfsc_drake.following.assembly import ControllerAssembly
from pfsc_drake.following.fault_description import FaultScene, FoundFault, describe
from pfsc_drake.following.law import make_law
from pfsc_drake.following.planning.drive_limits import keep_drive_limits
from pfsc_drake.following.planning.motion_demand import MotionDemand
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.geometry.progress import Progress
from pfsc_drake.robot.robot_model import pose_function
from pfsc_drake.systems.block_system import BlockSystem
from pfsc_drake.systems.following_controller import ControllerAccess, FollowingController
from pfsc_drake.systems.fuse import BlockAccess

# before the names of all systems and signals of the robot that holds the workpiece
HOLDER = "holder_"


@dataclass
class Holder:
    """A robot that holds the workpiece.

    Attributes:
        parameters: What the scenario says of it.
        part: The robot, whose tool frame is the workpiece's.
        task: What it does with the workpiece.
        law: Its law.
        controller: Its controller.
        initial_state: State of its model at the start.
        start: Where the workpiece is at the start.
        on_motors: Whether its law acts on the pose of the motors.
        frame: The workpiece's frame, and its motion as the other controller knows it.
        plan: Returns its motion as it is planned, see :func:`planned_frame`.
        signals: What to log, by names with the prefix.
        warn: Tells what there is to say, one sentence each.
        projector: Name of what finds the workpiece's place on its path.
        measured: System and port that the measured joint state comes from, by name.
        reaction: What it bears of the process on the workpiece, if there is one.
    """

    parameters: HolderParameters
    part: Arm
    task: Task
    law: FollowingLaw
    controller: ControllerAccess
    initial_state: np.ndarray
    start: StartPoint
    on_motors: bool
    frame: HeldFrame
    plan: Callable[[], PiecewisePolynomialCurve]
    signals: dict[str, OutputPort]
    warn: Callable[[], list[str]]
    projector: str
    measured: tuple[str, str]
    reaction: HeldReaction | None = None

    def set_start(self, blocks: BlockAccess, root: Context) -> None:
        """Put the robot at its start.

        Args:
            blocks: Blocks of the diagram.
            root: Context of the diagram.
        """
        self.part.place(self.part.plant.GetMyMutableContextFromRoot(root), self.initial_state)
        blocks.set_state(root, f"{self.projector}.place", self.start.place)

    def found_fault(self, log: SignalLog, blocks: BlockAccess, root: Context) -> FoundFault | None:
        """Return why the robot's controller is in its safe state, if it is.

        Args:
            log: Log of the station.
            blocks: Blocks of the diagram.
            root: Context of the diagram.
        """
        fault = self.controller.fault(blocks, root)
        if fault is Fault.NONE:
            return None
        suspects = self.controller.suspects(blocks, root)
        own, column = log.of(HOLDER), self.law.layout.status.start
        now, before = first_instant(own, blocks, root, "law", column)
        place, robot = self.task.place, self.part.belief.robot
        oscillating = oscillation_before(now.time, own, root, self.law)
        scene = FaultScene(
            self.law, robot, place, self.on_motors, now, before, suspects, oscillating
        )
        sentence = f"the robot that holds the workpiece: {describe(fault, scene)}"
        return FoundFault(sentence, now.time)


def add_holder(
    builder: DiagramBuilder,
    scenario: Scenario,
    order: int,
    folder: FilePath,
    progress: Progress | None = None,
    like: Holder | None = None,
) -> tuple[Holder, FollowingController]:
    """Add the robot that holds the workpiece of a scenario, with its controller.

    All of its systems have names that begin with ``holder_``.

    Args:
        builder: Builder of the diagram.
        scenario: The scenario, with a holder.
        order: Relative degree of the other robot's law, for which the workpiece's motion is told.
        folder: Where relative file names start.
        progress: Told the fraction done and what is done, where that takes its time.
        like: The same but for how it is integrated, if it has been built.

    Returns:
        The robot, and its controller in the diagram.

    Raises:
        InputError: If it cannot be built, or does not suit the other robot.
    """
    holder, own = scenario.holder, holder_scenario(scenario)
    assert holder is not None
    model = scenario.robot.model
    require(not is_delta(model), "robot.model", model, "a serial arm where there is a holder")
    named, period = PrefixingBuilder(builder, HOLDER), scenario.controller.sampling_time
    with naming_holder():
        _check(holder, period, order)
        task = make_task(own, folder, progress) if like is None else like.task
        part = add_arm(named, holding(belief_source(own, folder), holder.workpiece))
        task.require_joints(part.robot.dimension)
        start, state = (
            find_start(own.start, task, part) if like is None else (like.start, like.initial_state)
        )
        rest = cache(lambda: find_rest(task, part, start, state))
        believed = part.belief.robot
        law = make_law(own.controller, believed, task.manifold, rest, own.faults)
        rubbing = friction_options(own, folder)
        friction = believed_friction(part, own.controller.friction.believed, rubbing)
        q_J = (part.coordinates.link_rows @ state)[: part.robot.dimension]
        begun = CourseStart(rest().q_J, start.place)
        asked, chosen = own.reference, own.controller
        keep_drive_limits(asked, chosen, scenario.duration, task, law, begun, friction)
        demand = MotionDemand(asked, chosen, task, law, begun, friction)
        plan = cache(lambda: planned_frame(demand, task.motion, _placement(holder)))
        true_state = part.joint_state(named)
        failure = own.simulation.sensor_failure
        measured = add_joint_state(
            named, true_state, part.robot, own.encoders, failure, period, period
        )
        links = add_link_state(
            named, part, own.controller, own.encoders, measured, true_state, q_J, friction
        )
        known = believed_robot(believed, own.encoders, period, friction)
        assembly = ControllerAssembly(
            named, task, law, known, following_options(own), q_J, carries=True
        )
        with naming_reference():
            assembly.add_place(links.joint_state)
        reaction, told = None, own.controller.external_torque.source
        if scenario.forces:
            seen = assembly.signals["tool_pose"] if told == "measured" else None
            reaction = add_held_reaction(named, part, true_state, seen, period)
        forces = {} if reaction is None else reaction.forces
        controller, made = assembly.add_law(forces)
    drive = controller.GetOutputPort(controller.drive_port)
    if links.drive_torque is not None:
        builder.Connect(drive, links.drive_torque)
    ports = assembly.signals | {"drive": drive}
    add_drives(named, part, None, DriverParameters(), period, ports, state)
    rubs = add_friction(named, part, true_state, rubbing, [made["stop_category"]])
    motion = _add_motion(named, holder, law, order, controller, plan)
    pose = np.array(pose_function(part.robot)(q_J)).ravel()
    logged = assembly.signals | made | rubs | forces | {"frame_jet": motion}
    logged |= states_to_log(true_state, assembly.signals["joint_state"])
    source = measured.get_system().get_name(), measured.get_name()
    planned = [] if task.drive_plan is None else task.drive_plan.said
    link_state = part.coordinates.link_rows @ state

    def warn() -> list[str]:
        said = task.warnings + own.model_error.warnings + planned
        said += part.start_warnings(own.start, q_J, start.target)
        said += controller_warnings(_alone(own), task, part, law, link_state, rest())
        return [f"the robot that holds the workpiece: {line}" for line in said]

    made_holder = Holder(
        holder,
        part,
        task,
        law,
        ControllerAccess(controller),
        state,
        start,
        assembly.on_motors,
        HeldFrame(pose, order, motion),
        plan,
        {f"{HOLDER}{name}": port for name, port in logged.items()},
        warn,
        assembly.projector.get_name(),
        source,
        reaction,
    )
    return made_holder, controller


def stop_both(
    builder: DiagramBuilder, first: FollowingController, second: FollowingController
) -> None:
    """Let a fault of one of two controllers stop the other's robot as well.

    The second one's stops the first at the same tick. The first one's stops the second at the next
    tick, since both at once would ask each other.

    Args:
        builder: Builder of the diagram.
        first: The controller that acts on what the second one tells.
        second: The other.
    """
    period = first.period
    hold = builder.AddNamedSystem(f"{HOLDER}stop", BlockSystem(Hold(1), period))
    builder.Connect(second.GetOutputPort("fault"), first.GetInputPort("stop_request"))
    builder.Connect(first.GetOutputPort("fault"), hold.GetInputPort("value"))
    builder.Connect(hold.GetOutputPort("held"), second.GetInputPort("stop_request"))


@contextmanager
def naming_holder() -> Iterator[None]:
    """Name the block of the scenario in what is said against the robot that holds."""
    try:
        yield
    except InputError as error:
        message = str(error)
        raise InputError(
            message if message.startswith("holder.") else f"holder.{message}"
        ) from None


def _alone(own: Scenario) -> Scenario:
    """Return a holder's scenario for what is said of it: it has no force sensor of its own."""
    torque = own.controller.external_torque
    if torque.source != "measured":
        return own
    told = dc.replace(own.controller, external_torque=dc.replace(torque, source="known"))
    return dc.replace(own, controller=told)


def _check(holder: HolderParameters, period: float, order: int) -> None:
    """Refuse what no holder can be."""
    model, own, law = holder.robot.model, holder.controller.sampling_time, holder.controller.law
    require(not is_delta(model), "robot.model", model, "a serial arm, which turns what it holds")
    holder.workpiece.check()
    allowed = f"a law of relative degree {order} or more, as the other robot's is"
    require(RELATIVE_DEGREE[law] >= order, "controller.law", law, allowed)
    require(own == period, "controller.sampling_time", own, f"{period:g} s, the other robot's")


def _add_motion(
    builder: DiagramBuilder,
    holder: HolderParameters,
    law: FollowingLaw,
    order: int,
    controller: FollowingController,
    plan: Callable[[], PiecewisePolynomialCurve],
) -> OutputPort:
    """Add what tells the workpiece's motion, and return its port."""
    robot, period = law.robot, controller.period
    highest = order if holder.derivatives == "known" else 0
    flange = FlangeFrame(
        robot,
        law.linearization.relative_degree,
        order,
        _placement(holder),
        min(highest, holder.highest),
    )
    frame = builder.AddNamedSystem("flange_frame", BlockSystem(flange, period))
    builder.Connect(controller.GetOutputPort("joint_jet"), frame.GetInputPort("joint_jet"))
    told = frame.GetOutputPort("frame_jet")
    if holder.derivatives == "differenced":
        block = DifferencedFrame(order, holder.highest, period)
        guess = builder.AddNamedSystem("differenced_frame", BlockSystem(block, period))
        builder.Connect(told, guess.GetInputPort("frame_jet"))
        told = guess.GetOutputPort("differenced")
    elif holder.derivatives == "planned":
        with naming_holder():
            timed = BlockSystem(TimedReference(plan(), order, POSE_SIZE, period), period)
        builder.AddNamedSystem("planned_motion", timed)
        mix = BlockSystem(PlannedFrame(order, holder.highest), period)
        builder.AddNamedSystem("planned_frame", mix)
        builder.Connect(told, mix.GetInputPort("frame_jet"))
        builder.Connect(timed.GetOutputPort("reference"), mix.GetInputPort("planned"))
        told = mix.GetOutputPort("mixed")
    assert told.size() == frame_size(order)
    return told


def _placement(holder: HolderParameters) -> np.ndarray:
    """Return where the base is believed to be against where it is, ``[p, R by rows]``, (12,)."""
    X_WB = holder.robot.base_pose.transform()
    shift = X_WB @ holder.placement_error.transform() @ X_WB.inverse()
    return np.concatenate([shift.translation(), shift.rotation().matrix().ravel()])
