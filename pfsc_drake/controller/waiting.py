"""Motion that waits for obstacles: predicted arm motion, stopping, and blocks."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.linearization import virtual_output_function
from pfsc_drake.control.law.reference import Transition
from pfsc_drake.control.law.waiting_reference import WaitingReference
from pfsc_drake.control.obstacles.elbow_clearance import ElbowClearance, ElbowParameters
from pfsc_drake.control.obstacles.obstacle_watch import STEPS, ArmAhead, ObstacleWatch
from pfsc_drake.control.obstacles.shapes import ObstacleShape
from pfsc_drake.control.obstacles.stoppable_scaling import StoppableScaling
from pfsc_drake.control.obstacles.watch_parameters import WatchParameters
from pfsc_drake.control.planning.joint_trajectory import TrajectoryStart
from pfsc_drake.control.planning.stopping import stopping_bandwidth
from pfsc_drake.controller.nominal_robot import Coefficients
from pfsc_drake.controller.options.follower_options import FollowerOptions
from pfsc_drake.controller.options.motion_limits import MotionLimits, limits_of
from pfsc_drake.controller.planning.drive_limits import DrivePlanner
from pfsc_drake.controller.tasks.task import Task
from pfsc_drake.errors import InputError, require
from pfsc_drake.robot.robot_model import pose_function
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.outline import arm_outline, outline_points
from pfsc_drake.systems.block_system import BlockSystem

# s, between samples of a trajectory on which stops begin
_TRAJECTORY_STEP = 4e-3
# largest share of the planned speed that counts as rest
_MOST_REST = 0.2
# m or rad, distance from which on a tool starts beside its path
_AT_THE_PATH = 5e-3


def waiting_motion(
    planner: DrivePlanner,
    law: FollowingLaw,
    watch: WatchParameters,
    added: Callable[[np.ndarray], np.ndarray] | None = None,
) -> tuple[ArmAhead, StoppableScaling]:
    """Return the predicted motion of the arm, and its stoppable speed scaling.

    Args:
        planner: Planner of the joint motion.
        law: The law, of an arm that is a serial chain.
        watch: Parameters of the watch of obstacles.
        added: Derivatives 0..r that are added to those of the reference at times [s], shape
            (samples, r + 1, m), if any are.

    Raises:
        InputError: If the joints cannot follow, or the motion cannot be stopped.
    """
    chain, order = law.robot, law.linearization.relative_degree
    assert isinstance(chain, SerialChain)
    motion, begin = planner.motion, float(planner.motion.domain[0])
    try:
        step, trajectory = planner.trajectory(_TRAJECTORY_STEP, added)
    except InputError as error:
        raise InputError(f"obstacles: the reference cannot be followed: {error}") from None
    allowed = planner.allowed(trajectory, watch.reserve)
    bandwidth = stopping_bandwidth(planner.demand, trajectory, step, allowed, order)
    known = begin + step * np.arange(len(trajectory))
    speed = float(np.abs(motion.derivatives(known, 1)[:, 1]).max())
    resting = min(watch.resting_speed / speed, _MOST_REST)
    coarse = watch.horizon / STEPS
    times = begin + coarse * np.arange(int(np.ceil((known[-1] - begin) / coarse)) + 1)
    q = np.array([np.interp(times, known, column) for column in trajectory[:, 0].T])
    outline = arm_outline(chain, watch.arm_radius)
    points = outline_points(chain, outline).map(len(times))(q).full().T
    return (
        ArmAhead(chain, outline, begin, coarse, points),
        StoppableScaling(order, bandwidth, resting),
    )


@dataclass(frozen=True)
class Waiting:
    """Motion that waits for obstacles.

    Attributes:
        shapes: The obstacles.
        watch: Parameters of the watch.
        ahead: Predicted motion of the arm.
        scaling: Stoppable speed scaling.
        elbow: Avoidance by the elbow of a redundant arm, if there is any.
    """

    shapes: Sequence[ObstacleShape]
    watch: WatchParameters
    ahead: ArmAhead
    scaling: StoppableScaling
    elbow: ElbowParameters | None

    @property
    def elbow_clearance(self) -> ElbowClearance:
        """Block for the avoidance of obstacles by the elbow."""
        assert self.elbow is not None
        ahead, age = self.ahead, self.watch.latency
        return ElbowClearance(ahead.chain, ahead.outline, self.shapes, self.elbow, age)


def add_waiting(
    builder: DiagramBuilder,
    reference: WaitingReference,
    waiting: Waiting,
    period: float,
    joint_state: OutputPort,
) -> tuple[BlockSystem, BlockSystem]:
    """Add a waiting reference, and its watch of obstacles.

    Args:
        builder: Builder of the diagram.
        reference: The reference.
        waiting: Parameters of the waiting motion.
        period: Sampling time [s].
        joint_state: ``[q_J, v_J, q_M, v_M]`` as measured.

    Returns:
        The reference and the watch, whose ports ``obstacles`` and ``requested`` stay open.
    """
    generator = builder.AddNamedSystem("reference_generator", BlockSystem(reference, period))
    block = ObstacleWatch(waiting.ahead, waiting.shapes, waiting.watch, waiting.scaling, period)
    watches = builder.AddNamedSystem("obstacle_watch", BlockSystem(block, period))
    builder.Connect(generator.GetOutputPort("clock"), watches.GetInputPort("clock"))
    builder.Connect(joint_state, watches.GetInputPort("joint_state"))
    builder.Connect(watches.GetOutputPort("override"), generator.GetInputPort("override"))
    return generator, watches


@dataclass(frozen=True)
class Approach:
    """Motion of the tool from its start to its path.

    Attributes:
        q_J: Joint coordinates at the start, shape (N,).
        duration: Duration of the transition [s].
    """

    q_J: np.ndarray
    duration: float

    def reference(
        self, task: Task, law: FollowingLaw, start: TrajectoryStart
    ) -> Callable[[np.ndarray], np.ndarray] | None:
        """Return the addition to derivatives 0..r of the reference at times [s], if there is one.

        Args:
            task: Task of the tool.
            law: Its law.
            start: Start of the robot.

        Raises:
            InputError: If the tool starts beside its path without a transition.
        """
        robot, linearization = law.robot, law.linearization
        assert task.motion is not None  # of a planned task
        y_t = np.array(pose_function(robot)(self.q_J)).ravel()[:3]
        point = task.evaluate(y_t, start.memory)
        output = virtual_output_function(robot, linearization.manifold)
        distance = np.array(output(self.q_J, np.zeros(robot.dimension), point))[:, 0]
        initial = task.motion.derivatives(task.motion.domain[:1], 0)[0, 0]
        distance[: len(initial)] -= initial
        if self.duration == 0.0:
            far = float(np.abs(distance).max())
            allowed = (
                f"0.1 to 10 s if the tool starts beside its path (by {far:.3g} m or rad): only "
                "a transition waits for obstacles"
            )
            require(far < _AT_THE_PATH, "start.transition", self.duration, allowed)
            return None
        transition = Transition(self.duration, linearization.relative_degree)

        def added(times: np.ndarray) -> np.ndarray:
            shares = np.array([transition.at(time).full().ravel() for time in times.tolist()])
            return shares[:, :, None] * distance

        return added


def plan_waiting(
    options: FollowerOptions,
    task: Task,
    law: FollowingLaw,
    start: TrajectoryStart,
    friction: Coefficients | None,
    q_J: np.ndarray,
) -> Waiting:
    """Return the plan of a motion along a manifold that waits for obstacles.

    Args:
        options: Options, with obstacles.
        task: Task of the tool, its motion within the limits of the drives.
        law: Its law.
        start: Start of the robot.
        friction: Coefficients f_c and f_v of the nominal model, each (N,), if there are any.
        q_J: Joint coordinates at the start, shape (N,).

    Raises:
        InputError: If task or options cannot wait, or the joints cannot follow.
    """
    obstacles, motion, chosen = options.obstacles, task.motion, options.controller
    assert obstacles is not None
    allowed = "None unless a path or surface at rest is followed by a motion over time, stiffly"
    waits = task.is_planned and not task.manifold.follows_time and options.stream is None
    waits = waits and options.frame is None and not options.compliance.is_given
    require(waits and not options.swings, "obstacles", "given", allowed)
    assert motion is not None
    if not isinstance(law.robot, SerialChain):
        raise InputError("obstacles = given: must be null for a robot that is not a chain of links")
    if obstacles.elbow is not None:
        allowed = (
            "null for an arm without redundant joints, and one whose posture complies with forces"
        )
        spare = law.posture is not None and chosen.posture.yields == "none"
        require(spare, "obstacles.elbow", "given", allowed)
    limits = options.reference or limits_of(motion, MotionLimits())
    planned = replace(options, reference=limits)
    planner = DrivePlanner(planned, task, law, start, friction)
    added = Approach(q_J, options.transition).reference(task, law, start)
    ahead, scaling = waiting_motion(planner, law, obstacles.watch, added)
    return Waiting(obstacles.shapes, obstacles.watch, ahead, scaling, obstacles.elbow)
