"""What carries a task's path or surface: a frame that moves, and how the law learns of it."""

from dataclasses import dataclass, replace

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from diagrams.tasks.task import ManifoldProjector, Task
from pfsc_drake.control.manifolds.carried import FramedPoint, SeenTool
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.control.manifolds.moving_frame import POSE_SIZE, FramedLayout, MovingFrameManifold
from pfsc_drake.robot.inverse_kinematics import ToolTarget
from pfsc_drake.systems.block_system import BlockSystem


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

    @property
    def rotation(self) -> np.ndarray:
        """``R_WC`` at the start, shape (3, 3)."""
        return self.start[3:].reshape(3, 3)

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
        R_WC = self.rotation
        R_e = None if target.R_e is None else R_WC @ target.R_e
        yaw_axis = None if target.yaw_axis is None else R_WC @ target.yaw_axis
        return replace(target, y_t=self.start[:3] + R_WC @ target.y_t, R_e=R_e, yaw_axis=yaw_axis)

    def resting_point(self, point: np.ndarray) -> np.ndarray:
        """Return a manifold's point with the frame at rest where it starts.

        Args:
            point: The manifold's point in the frame.
        """
        return np.concatenate([point, self.start, np.zeros(POSE_SIZE * self.order)])

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
        seen = builder.AddNamedSystem("seen_tool", BlockSystem(SeenTool(self.order), period))
        builder.Connect(tool_pose, seen.GetInputPort("tool_pose"))
        builder.Connect(self.motion, seen.GetInputPort("frame_jet"))
        place = task.add_place(builder, seen.GetOutputPort("seen"), reference, period)
        layout = FramedLayout(task.manifold.layout)
        framed = builder.AddNamedSystem("framed_point", BlockSystem(FramedPoint(layout), period))
        builder.Connect(place.manifold_point, framed.GetInputPort("manifold_point"))
        builder.Connect(self.motion, framed.GetInputPort("frame_jet"))
        point = framed.GetOutputPort("framed_point")
        return ManifoldProjector(place.projector, point), seen.GetOutputPort("seen")


def law_manifold(task: Task, held: HeldFrame | None) -> Manifold:
    """Return the manifold that a law makes linear.

    Args:
        task: What the tool is to do.
        held: What carries its manifold, if anything does.
    """
    return task.manifold if held is None else held.manifold(task)
