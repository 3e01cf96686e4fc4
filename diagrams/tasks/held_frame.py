"""What carries a task's path or surface: a frame that moves, and how the law learns of it."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import OutputPort

from diagrams.tasks.task import Task
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.control.manifolds.moving_frame import MovingFrameManifold
from pfsc_drake.following.carried import placed, resting_point
from pfsc_drake.robot.inverse_kinematics import ToolTarget


@dataclass(frozen=True)
class HeldFrame:
    """A frame C in the world that carries a manifold.

    Attributes:
        start: Its pose at the start ``[p_WC, R_WC by rows]`` [m, 1], shape (12,).
        order: Highest derivative of its motion that is known.
        motion: Derivatives 0..order, see :func:`frame_jets`; None of one that is only planned.
    """

    start: np.ndarray
    order: int
    motion: OutputPort | None = None

    def manifold(self, task: Task) -> MovingFrameManifold:
        """Return a task's manifold in the frame, as the law sees it.

        Args:
            task: The task.
        """
        return MovingFrameManifold(task.manifold)

    def placed(self, target: ToolTarget) -> ToolTarget:
        """Return where in the world a pose in the frame is at the start.

        Args:
            target: The pose in the frame.
        """
        return placed(target, self.start)

    def resting_point(self, point: np.ndarray) -> np.ndarray:
        """Return a manifold's point with the frame at rest where it starts.

        Args:
            point: The manifold's point in the frame.
        """
        return resting_point(point, self.start, self.order)


def law_manifold(task: Task, held: HeldFrame | None) -> Manifold:
    """Return the manifold that a law makes linear.

    Args:
        task: What the tool is to do.
        held: What carries its manifold, if anything does.
    """
    return task.manifold if held is None else held.manifold(task)
