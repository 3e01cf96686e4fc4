"""Progress that waits for obstacles: the arm's way ahead, how it can be stopped, and the blocks."""

from collections.abc import Sequence
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
from pfsc_drake.control.planning.course import CourseFinder, CourseStart
from pfsc_drake.control.planning.drive_demand import (
    DriveDemand,
    DriveLimits,
    allowed_demand,
    with_pace,
)
from pfsc_drake.control.planning.stopping import stopping_bandwidth
from pfsc_drake.errors import InputError, require
from pfsc_drake.following.options.follower import FollowerOptions
from pfsc_drake.following.task import Followed
from pfsc_drake.geometry import PiecewisePolynomialCurve
from pfsc_drake.robot.robot_model import largest_speeds
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.outline import arm_outline, outline_points
from pfsc_drake.systems.block_system import BlockSystem

# s, from sample to sample of a course on which stops begin
COURSE_STEP = 4e-3
# of the planned pace, the most that may count as rest
_MOST_REST = 0.2


@dataclass(frozen=True)
class JointCourse:
    """How joints move along a motion.

    Attributes:
        step: From sample to sample [s].
        course: Coordinates and derivatives, shape (samples, K + 1, N).
        demand: What it asks of the drives.
        allowed: What may be asked at each sample, shape (samples, 2N).
    """

    step: float
    course: np.ndarray
    demand: DriveDemand
    allowed: np.ndarray


def joint_course(
    named: tuple[FollowingLaw, str],
    followed: Followed,
    q_J: np.ndarray,
    friction: tuple[np.ndarray, np.ndarray] | None,
    reserve: float,
) -> JointCourse:
    """Return how the joints of a robot move along what it follows.

    Args:
        named: The law, and its name.
        followed: The path that is followed, and the motion along it.
        q_J: Joints' coordinates at the start, shape (N,).
        friction: Coefficients f_c and f_v that the drives overcome besides, if any are believed.
        reserve: Share of the drives' torques and speeds that is left.

    Raises:
        InputError: If the joints cannot follow.
    """
    law, name = named
    robot, motion, order = law.robot, followed.motion, law.linearization.relative_degree
    assert motion is not None
    assert followed.projection is not None
    f_c, f_v = friction or (np.zeros(robot.dimension),) * 2
    demand = DriveDemand(robot, name, f_v)
    begin, end = (float(limit) for limit in motion.domain)
    times = np.linspace(begin, end, int(np.ceil((end - begin) / COURSE_STEP)) + 1)
    asked = motion.derivatives(times, order)
    manifold = law.linearization.manifold
    assert isinstance(manifold, PathManifold)  # what has a projection
    reference = np.zeros((len(times), order + 1, len(manifold.coordinates)))
    reference[:, :, : asked.shape[2]] = asked
    finder = CourseFinder(robot, manifold, followed.projection, law.inverse, law.posture)
    start = CourseStart(q_J, followed.point[manifold.layout.memory])
    course, step = finder.find(start, reference, times), float(times[1] - times[0])
    while course.shape[1] <= demand.derivatives:
        further = np.gradient(course[:, -1:], step, axis=0)
        course = np.concatenate([course, further], axis=1)
    course = course[:, : demand.derivatives + 1]
    effort = np.maximum(robot.gather("effort_limit") - f_c, 1e-9)
    limits = DriveLimits(effort, largest_speeds(robot)).together
    at_rest = demand.of(with_pace(course, np.zeros((len(course), 4))))
    return JointCourse(step, course, demand, allowed_demand(at_rest, limits, reserve))


def waiting_motion(
    chain: SerialChain,
    watch: WatchParameters,
    motion: PiecewisePolynomialCurve,
    order: int,
    joints: JointCourse,
) -> tuple[ArmAhead, WaitingPace]:
    """Return where the arm will be, and how the motion can be stopped.

    Args:
        chain: The arm as it is believed.
        watch: How it keeps away from obstacles.
        motion: Tangential coordinates over time [m].
        order: r of the law.
        joints: How the joints move along it.
    """
    step, course, begin = joints.step, joints.course, float(motion.domain[0])
    bandwidth = stopping_bandwidth(joints.demand, course, step, joints.allowed, order)
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
    named: tuple[FollowingLaw, str], followed: Followed, options: FollowerOptions, q_J: np.ndarray
) -> Waiting:
    """Return how a motion along a path waits for obstacles.

    Args:
        named: The law, and its name.
        followed: What is followed.
        options: What is chosen, with obstacles.
        q_J: Joints' coordinates at the start, shape (N,).

    Raises:
        InputError: If what is followed or chosen cannot wait, or the joints cannot follow.
    """
    law, obstacles, motion = named[0], options.obstacles, followed.motion
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
    chain, watch = law.robot, obstacles.watch
    if not isinstance(chain, SerialChain):
        raise InputError("obstacles: given; must be None for a robot that is no chain of links")
    if obstacles.elbow is not None:
        allowed = "None for an arm without joints to spare, and one whose posture yields to forces"
        spare = law.posture is not None and options.controller.posture.yields == "none"
        require(spare, "obstacles.elbow", "given", allowed)
    joints = joint_course(named, followed, q_J, options.friction, watch.reserve)
    order = law.linearization.relative_degree
    ahead, pace = waiting_motion(chain, watch, motion, order, joints)
    return Waiting(obstacles.shapes, watch, ahead, pace, obstacles.elbow)
