"""Start of a robot: pose of its tool, posture, and state of the plant."""

import numpy as np

from diagrams.environment.mounting import Mounting
from diagrams.robots.part import RobotPart
from diagrams.robots.workpiece import Workpiece
from diagrams.scenario import StartParameters
from diagrams.scenario_task import inverted_start
from pfsc_drake.controller.moving_start import target_in_world
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
    """Return the start of the tool, and the state of the plant there, at rest.

    Args:
        parameters: Its parameters in the scenario.
        task: Task of the tool.
        part: The robot.
        workpiece: Workpiece that the tool touches, if there is one.
        mounting: Poses of magazine and frame, if plates are mounted.
        frame: Pose of the frame that carries the manifold, ``[p_WC, R_WC by rows]``, if it moves.

    Raises:
        InputError: If the start or a position of the motion is known to be out of reach.
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
    # a workpiece that moves may bring its path into reach, or out of it
    for position, where in () if frame is not None else task.tool_positions():
        part.check_reach(position, where)
    return start, part.state_at_rest(q_J)


def _posture(
    parameters: StartParameters,
    task: Task,
    part: RobotPart,
    start: StartPoint,
    frame: np.ndarray | None,
) -> np.ndarray:
    """Return the joints at the start, shape (N,); advise if only the inverted pose is in reach."""

    def found(target: ToolTarget) -> np.ndarray:
        return part.posture(target if frame is None else target_in_world(target, frame), parameters)

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
