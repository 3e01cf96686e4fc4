"""Progress that waits for obstacles: what is known beforehand of the arm's way, and of stops."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from diagrams.scenario import ReferenceParameters
from diagrams.scenario.checks import require
from diagrams.scenario.obstacles import CrossingParameters
from diagrams.tasks.path_following import TrajectoryTask
from diagrams.tasks.space_guidance import SpaceTask
from diagrams.tasks.task import Task
from pfsc_drake.control.law.following_law import FollowingLaw
from pfsc_drake.control.law.linearization import virtual_output_function
from pfsc_drake.control.law.reference import Transition
from pfsc_drake.control.planning.course import CourseStart
from pfsc_drake.errors import InputError
from pfsc_drake.following.options.controller import ControllerParameters
from pfsc_drake.following.planning.drive_limits import DrivePlanner
from pfsc_drake.following.waiting import Waiting, waiting_motion
from pfsc_drake.robot.robot_model import pose_function
from pfsc_drake.robot.serial.chain import SerialChain

# m or rad, from which on a tool starts beside its path
_AT_THE_PATH = 5e-3


@dataclass(frozen=True)
class CrossingWait(Waiting):
    """Progress that waits for the obstacles of a scenario.

    Attributes:
        crossing: The obstacles.
    """

    crossing: CrossingParameters


@dataclass(frozen=True)
class Approach:
    """Way of the tool from where it starts to its path.

    Attributes:
        q_J: Joint coordinates at the start, shape (N,).
        duration: How long it takes [s], ``start.transition``.
    """

    q_J: np.ndarray
    duration: float

    def reference(
        self, task: Task, law: FollowingLaw, start: CourseStart
    ) -> Callable[[np.ndarray], np.ndarray] | None:
        """Return what is added to derivatives 0..r of the reference at times [s], if anything is.

        Args:
            task: What the tool is to do.
            law: The law that does it.
            start: Where the robot starts.

        Raises:
            InputError: If the tool starts beside its path and would come to it at once.
        """
        robot, linearization = law.robot, law.linearization
        y_t = np.array(pose_function(robot)(self.q_J)).ravel()[:3]
        point = task.evaluate(y_t, start.memory)
        output = virtual_output_function(robot, linearization.manifold)
        distance = np.array(output(self.q_J, np.zeros(robot.dimension), point))[:, 0]
        begun = task.motion.derivatives(task.motion.domain[:1], 0)[0, 0]
        distance[: len(begun)] -= begun
        if self.duration == 0.0:
            far = float(np.abs(distance).max())
            allowed = (
                f"0.1 to 10 s where the tool starts beside its path (by {far:.3g} m or rad): only "
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
    crossing: CrossingParameters,
    reference: ReferenceParameters,
    controller: ControllerParameters,
    task: Task,
    law: FollowingLaw,
    start: CourseStart,
    friction: tuple[np.ndarray, np.ndarray] | None,
    approach: Approach,
) -> CrossingWait:
    """Return how the progress of a task waits for obstacles.

    Args:
        crossing: The obstacles.
        reference: The reference.
        controller: What is chosen of the controller.
        task: What the tool is to do, its motion as the drives can follow it.
        law: The law that does it.
        start: Where the robot starts.
        friction: Coefficients f_c and f_v that the drives overcome besides, if any are believed.
        approach: How the tool comes to the path, which waits for obstacles as progress does.

    Raises:
        InputError: If nothing is followed that could wait, or the arm's way is not known.
    """
    followed = not isinstance(task, SpaceTask | TrajectoryTask)
    allowed = "null unless controller.manifold is path or surface, on which progress can wait"
    require(followed, "obstacles", "given", allowed)
    if not isinstance(law.robot, SerialChain):
        raise InputError("obstacles = given: must be null for a robot that is no chain of links")
    require(not reference.swings, "reference.swings", "given", "none where there are obstacles")
    if crossing.elbow is not None:
        allowed = "null for an arm without joints to spare, and one whose posture yields to forces"
        spare = law.posture is not None and controller.posture.yields == "none"
        require(spare, "obstacles.elbow", "given", allowed)
    watch = crossing.watch
    planner = DrivePlanner(reference, controller, 0.0, task, law, start, friction)
    ahead, pace = waiting_motion(planner, law, watch, approach.reference(task, law, start))
    shapes = [obstacle.shape for obstacle in crossing.moving]
    return CrossingWait(shapes, watch, ahead, pace, crossing.elbow, crossing)
