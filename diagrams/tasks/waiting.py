"""Progress that waits for obstacles: what is known beforehand of the arm's way, and of stops."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.scenario import ReferenceParameters
from diagrams.scenario.checks import require
from diagrams.scenario.obstacles import CrossingParameters
from diagrams.tasks.drive_limits import DrivePlanner
from diagrams.tasks.path_following import TrajectoryTask
from diagrams.tasks.space_guidance import SpaceTask
from diagrams.tasks.task import Task
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.waiting_reference import WaitingReference
from pfsc_drake.control.obstacles.elbow_room import ElbowRoom
from pfsc_drake.control.obstacles.obstacle_watch import ArmAhead
from pfsc_drake.control.obstacles.waiting_pace import WaitingPace
from pfsc_drake.control.planning.course import CourseStart
from pfsc_drake.errors import InputError
from pfsc_drake.following.options.controller import ControllerParameters
from pfsc_drake.following.waiting import COURSE_STEP, JointCourse, add_waiting, waiting_motion
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.systems.block_system import BlockSystem


@dataclass(frozen=True)
class Waiting:
    """How progress waits.

    Attributes:
        crossing: The obstacles.
        ahead: Where the arm will be.
        pace: How the motion can be stopped.
    """

    crossing: CrossingParameters
    ahead: ArmAhead
    pace: WaitingPace


def plan_waiting(
    crossing: CrossingParameters,
    reference: ReferenceParameters,
    controller: ControllerParameters,
    task: Task,
    law: FollowingLaw,
    start: CourseStart,
    friction: tuple[np.ndarray, np.ndarray] | None,
) -> Waiting:
    """Return how the progress of a task waits for obstacles.

    Args:
        crossing: The obstacles.
        reference: The reference.
        controller: What is chosen of the controller.
        task: What the tool is to do, its motion as the drives can follow it.
        law: The law that does it.
        start: Where the robot starts.
        friction: Coefficients f_c and f_v that the drives overcome besides, if any are believed.

    Raises:
        InputError: If nothing is followed that could wait, or the arm's way is not known.
    """
    followed = not isinstance(task, SpaceTask | TrajectoryTask)
    allowed = "null unless controller.manifold is path or surface, on which progress can wait"
    require(followed, "obstacles", "given", allowed)
    chain = law.robot
    if not isinstance(chain, SerialChain):
        raise InputError("obstacles = given: must be null for a robot that is no chain of links")
    require(not reference.swings, "reference.swings", "given", "none where there are obstacles")
    if crossing.elbow is not None:
        allowed = "null for an arm without joints to spare, and one whose posture yields to forces"
        spare = law.posture is not None and controller.posture.yields == "none"
        require(spare, "obstacles.elbow", "given", allowed)
    watch = crossing.watch
    planner = DrivePlanner(reference, controller, 0.0, task, law, start, friction)
    try:
        step, course = planner.course(COURSE_STEP)
    except InputError as error:
        raise InputError(f"obstacles: the course of the reference is {error}") from None
    allowed_demand = planner.allowed(course, watch.reserve)
    joints = JointCourse(step, course, planner.demand, allowed_demand)
    order = law.linearization.relative_degree
    ahead, pace = waiting_motion(chain, watch, task.motion, order, joints)
    return Waiting(crossing, ahead, pace)


def add_waiting_reference(
    builder: DiagramBuilder,
    waiting: Waiting,
    task: Task,
    outputs: int,
    period: float,
    ports: dict[str, OutputPort],
) -> dict[str, OutputPort]:
    """Add a reference that waits for obstacles.

    Args:
        builder: Builder of the diagram.
        waiting: How.
        task: What the tool is to do.
        outputs: Number of outputs.
        period: Sampling time [s].
        ports: ``joint_state`` and ``obstacles_measured``, and ``override`` if somebody may ask for
            another pace.

    Returns:
        ``reference``, and for the log ``clock`` and ``watch``; of an elbow that gives way
        ``posture_torque``.
    """
    timed = WaitingReference(task.motion, waiting.pace, outputs, period)
    shapes = [obstacle.shape for obstacle in waiting.crossing.moving]
    generator, watch = add_waiting(
        builder,
        timed,
        waiting.ahead,
        shapes,
        waiting.crossing.watch,
        waiting.pace,
        period,
        ports["joint_state"],
    )
    builder.Connect(ports["obstacles_measured"], watch.GetInputPort("obstacles"))
    if "override" in ports:
        builder.Connect(ports["override"], watch.GetInputPort("asked"))
    made = {}
    if waiting.crossing.elbow is not None:
        ahead, age = waiting.ahead, waiting.crossing.watch.latency
        room = ElbowRoom(ahead.chain, ahead.outline, shapes, waiting.crossing.elbow, age)
        elbow = builder.AddNamedSystem("elbow_room", BlockSystem(room, period))
        builder.Connect(ports["joint_state"], elbow.GetInputPort("joint_state"))
        builder.Connect(ports["obstacles_measured"], elbow.GetInputPort("obstacles"))
        made["posture_torque"] = elbow.GetOutputPort("torque")
    return made | {
        "reference": generator.GetOutputPort("reference"),
        "clock": generator.GetOutputPort("clock"),
        "watch": watch.GetOutputPort("record"),
    }
