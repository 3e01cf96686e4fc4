"""Progress that waits for obstacles: the arm's way ahead, how it can be stopped, and the blocks."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.waiting_reference import WaitingReference
from pfsc_drake.control.manifolds.path import PathManifold
from pfsc_drake.control.obstacles.elbow_room import ElbowParameters
from pfsc_drake.control.obstacles.obstacle_watch import STEPS, ArmAhead, ObstacleWatch
from pfsc_drake.control.obstacles.parameters import WatchParameters
from pfsc_drake.control.obstacles.shapes import ObstacleShape
from pfsc_drake.control.obstacles.waiting_pace import WaitingPace
from pfsc_drake.control.planning.course import CourseStart
from pfsc_drake.control.planning.stopping import stopping_bandwidth
from pfsc_drake.errors import InputError, require
from pfsc_drake.following.options.follower import FollowerOptions
from pfsc_drake.following.options.motion import MotionLimits, limits_of
from pfsc_drake.following.planning.drive_limits import DrivePlanner
from pfsc_drake.following.task import Followed
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.outline import arm_outline, outline_points
from pfsc_drake.systems.block_system import BlockSystem

# s, from sample to sample of a course on which stops begin
_COURSE_STEP = 4e-3
# of the planned pace, the most that may count as rest
_MOST_REST = 0.2


def waiting_motion(
    planner: DrivePlanner,
    law: FollowingLaw,
    watch: WatchParameters,
    added: Callable[[np.ndarray], np.ndarray] | None = None,
) -> tuple[ArmAhead, WaitingPace]:
    """Return where the arm will be, and how the motion can be stopped.

    Args:
        planner: Finds how the joints move along the motion.
        law: The law, of an arm that is a serial chain.
        watch: How it keeps away from obstacles.
        added: Derivatives 0..r that are added to those of the reference at times [s], shape
            (samples, r + 1, m), if any are.

    Raises:
        InputError: If the joints cannot follow, or the motion cannot be stopped.
    """
    chain, order = law.robot, law.linearization.relative_degree
    assert isinstance(chain, SerialChain)
    motion, begin = planner.motion, float(planner.motion.domain[0])
    try:
        step, course = planner.course(_COURSE_STEP, added)
    except InputError as error:
        raise InputError(f"obstacles: the reference cannot be followed: {error}") from None
    allowed = planner.allowed(course, watch.reserve)
    bandwidth = stopping_bandwidth(planner.demand, course, step, allowed, order)
    known = begin + step * np.arange(len(course))
    speed = float(np.abs(motion.derivatives(known, 1)[:, 1]).max())
    resting = min(watch.resting_speed / speed, _MOST_REST)
    coarse = watch.horizon / STEPS
    times = begin + coarse * np.arange(int(np.ceil((known[-1] - begin) / coarse)) + 1)
    q = np.array([np.interp(times, known, column) for column in course[:, 0].T])
    outline = arm_outline(chain, watch.arm_radius)
    points = outline_points(chain, outline).map(len(times))(q).full().T
    return (
        ArmAhead(chain, outline, begin, coarse, points),
        WaitingPace(order, bandwidth, resting),
    )


@dataclass(frozen=True)
class Waiting:
    """Progress that waits for obstacles.

    Attributes:
        shapes: The obstacles.
        watch: Parameters of the watch.
        ahead: Where the arm will be.
        pace: How the motion can be stopped.
        elbow: How the elbow of an arm with joints to spare complies, if it does.
    """

    shapes: Sequence[ObstacleShape]
    watch: WatchParameters
    ahead: ArmAhead
    pace: WaitingPace
    elbow: ElbowParameters | None


def add_waiting(
    builder: DiagramBuilder,
    reference: WaitingReference,
    waiting: Waiting,
    period: float,
    joint_state: OutputPort,
) -> tuple[BlockSystem, BlockSystem]:
    """Add a reference that waits, and what watches obstacles for it.

    Args:
        builder: Builder of the diagram.
        reference: The reference.
        waiting: How it waits.
        period: Sampling time [s].
        joint_state: ``[q_J, v_J, q_M, v_M]`` as measured.

    Returns:
        The reference and the watch, whose ports ``obstacles`` and ``asked`` are left open.
    """
    generator = builder.AddNamedSystem("reference_generator", BlockSystem(reference, period))
    block = ObstacleWatch(waiting.ahead, waiting.shapes, waiting.watch, waiting.pace, period)
    watches = builder.AddNamedSystem("obstacle_watch", BlockSystem(block, period))
    builder.Connect(generator.GetOutputPort("clock"), watches.GetInputPort("clock"))
    builder.Connect(joint_state, watches.GetInputPort("joint_state"))
    builder.Connect(watches.GetOutputPort("override"), generator.GetInputPort("override"))
    return generator, watches


def plan_waiting(
    law: FollowingLaw, followed: Followed, options: FollowerOptions, q_J: np.ndarray
) -> Waiting:
    """Return how a motion along a path waits for obstacles.

    Args:
        law: The law.
        followed: What is followed.
        options: What is chosen, with obstacles; its controller has the law's name.
        q_J: Joints' coordinates at the start, shape (N,).

    Raises:
        InputError: If what is followed or chosen cannot wait, or the joints cannot follow.
    """
    obstacles, motion = options.obstacles, followed.motion
    assert obstacles is not None
    allowed = "None unless a path at rest is followed by a motion over time, without yielding"
    manifold = followed.manifold
    on_path = isinstance(manifold, PathManifold) and not manifold.follows_time
    waits = motion is not None and on_path and options.stream is None
    waits = waits and options.frame is None and not options.compliance.is_given
    waits = waits and not options.swings
    require(waits, "obstacles", "given", allowed)
    assert motion is not None
    planned = "0 with obstacles, which are avoided along the path alone; bring the tool there first"
    require(options.transition == 0.0, "transition", options.transition, planned)
    watch = obstacles.watch
    if not isinstance(law.robot, SerialChain):
        raise InputError("obstacles: given; must be None for a robot that is no chain of links")
    if obstacles.elbow is not None:
        allowed = "None for an arm without joints to spare, and one whose posture yields to forces"
        spare = law.posture is not None and options.controller.posture.yields == "none"
        require(spare, "obstacles.elbow", "given", allowed)
    start = CourseStart(q_J, followed.point[followed.place.layout.memory])
    known = options.controller, 0.0, followed, law, start, options.friction
    planner = DrivePlanner(limits_of(motion, MotionLimits()), *known)
    ahead, pace = waiting_motion(planner, law, watch)
    return Waiting(obstacles.shapes, watch, ahead, pace, obstacles.elbow)
