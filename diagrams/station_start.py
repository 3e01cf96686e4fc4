"""Where a robot starts: the place of its tool, its posture, and how the law sees it."""

import numpy as np

from diagrams.environment.mounting import Mounting
from diagrams.robots.part import RobotPart
from diagrams.robots.workpiece import Workpiece
from diagrams.scenario import StartParameters
from diagrams.scenario_task import inverted_start
from pfsc_drake.controller.moving_start import placed
from pfsc_drake.controller.tasks.task import StartPoint, Task
from pfsc_drake.errors import InputError
from pfsc_drake.robot.inverse_kinematics import ToolTarget


def find_start(
    parameters: StartParameters,
    task: Task,
    part: RobotPart,
    workpiece: Workpiece | None = None,
    mounting: Mounting | None = None,
    frame: np.ndarray | None = None,
) -> tuple[StartPoint, np.ndarray]:
    """Return where the tool starts, and the state of the plant there, at rest.

    Args:
        parameters: What the scenario says of it.
        task: What the tool is to do.
        part: The robot.
        workpiece: What the tool touches, if anything.
        mounting: Where plates come from and go, if there are any.
        frame: Pose of the frame that carries the manifold, ``[p_WC, R_WC by rows]``, if it moves.

    Raises:
        InputError: If the start or the way from there is known to be out of reach.
    """
    shift = np.zeros(3)
    if workpiece is not None:
        shift = workpiece.start_shift(part.gravity)
    start = task.start(shift)
    if workpiece is not None:
        workpiece.check_start(start.target.y_t)
    if mounting is not None:
        start = mounting.start(start, task)
    q_J = _posture(parameters, task, part, start, frame)
    # what is carried is on its way to reach, or out of it
    for position, where in () if frame is not None else task.way():
        part.check_reach(position, where)
    return start, part.state_at_rest(q_J)


def _posture(
    parameters: StartParameters,
    task: Task,
    part: RobotPart,
    start: StartPoint,
    frame: np.ndarray | None,
) -> np.ndarray:
    """Return the joints at the start, shape (N,); say it if only the inverted one is in reach."""

    def found(target: ToolTarget) -> np.ndarray:
        return part.posture(target if frame is None else placed(target, frame), parameters)

    try:
        return found(start.target)
    except InputError as error:
        inverted = inverted_start(task, start)
        if inverted is None:
            raise
        target, advice = inverted
        try:
            found(target)
        except InputError:
            raise error from None
        raise InputError(f"{error}; {advice}") from None
