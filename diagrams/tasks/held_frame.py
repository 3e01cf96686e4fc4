"""What carries a task's path or surface: a frame that moves, and how the law learns of it."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.tasks.task import ManifoldProjector, Task
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.control.manifolds.moving_frame import MovingFrameManifold
from pfsc_drake.following.carried import add_framed_point, add_seen_tool, placed, resting_point
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

    def add_place(
        self,
        builder: DiagramBuilder,
        task: Task,
        tool_pose: OutputPort,
        reference: OutputPort | None,
        period: float,
    ) -> tuple[ManifoldProjector, OutputPort]:
        """Add what finds the tool's place on the manifold in its frame.

        Args:
            builder: Builder of the diagram.
            task: What the tool is to do.
            tool_pose: ``[y_t, R_e]`` in the world as measured, shape (12,).
            reference: Derivatives of the virtual output's reference by rows.
            period: Sampling time [s].

        Returns:
            What finds it, with the point and the frame for the law; and the tool's pose as it is
            seen from the frame.
        """
        assert self.motion is not None  # of what moves in a diagram
        seen = add_seen_tool(builder, tool_pose, self.motion, self.order, period)
        place = task.add_place(builder, seen, reference, period)
        own = task.manifold
        point = add_framed_point(builder, own, place.manifold_point, self.motion, period)
        return ManifoldProjector(place.projector, point), seen


def law_manifold(task: Task, held: HeldFrame | None) -> Manifold:
    """Return the manifold that a law makes linear.

    Args:
        task: What the tool is to do.
        held: What carries its manifold, if anything does.
    """
    return task.manifold if held is None else held.manifold(task)
