"""Manifold in a moving frame: start of the tool, and inputs of the law."""

from dataclasses import replace

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort

from pfsc_drake.control.manifolds.frame_motion import FramedPoint, RelativeTool
from pfsc_drake.control.manifolds.manifold import Manifold
from pfsc_drake.control.manifolds.moving_frame import POSE_SIZE, FramedLayout
from pfsc_drake.robot.inverse_kinematics import ToolTarget
from pfsc_drake.systems.block_system import BlockSystem


def target_in_world(target: ToolTarget, frame: np.ndarray) -> ToolTarget:
    """Return a target in a frame as a target in the world.

    Args:
        target: Target in the frame.
        frame: ``[p_WC, R_WC by rows]`` [m, 1], shape (12,).
    """
    R_WC = frame[3:].reshape(3, 3)
    R_e = None if target.R_e is None else R_WC @ target.R_e
    yaw_axis = None if target.yaw_axis is None else R_WC @ target.yaw_axis
    return replace(target, y_t=frame[:3] + R_WC @ target.y_t, R_e=R_e, yaw_axis=yaw_axis)


def resting_point(point: np.ndarray, frame: np.ndarray, order: int) -> np.ndarray:
    """Return a manifold point with a frame at rest, laid out by :class:`FramedLayout`.

    Args:
        point: Manifold point in the frame.
        frame: ``[p_WC, R_WC by rows]`` [m, 1], shape (12,).
        order: Relative degree of the law.
    """
    return np.concatenate([point, frame, np.zeros(POSE_SIZE * order)])


def add_relative_tool(
    builder: DiagramBuilder,
    tool_pose: OutputPort,
    frame_jet: OutputPort,
    order: int,
    period: float,
) -> OutputPort:
    """Add the pose of the tool relative to a frame, and return it, shape (12,).

    Args:
        builder: Builder of the diagram.
        tool_pose: ``[y_t, R_e by rows]`` in the world, shape (12,) [m, 1].
        frame_jet: Derivatives 0..order of the frame, see :func:`frame_jets`.
        order: Relative degree of the law.
        period: Sampling time [s].
    """
    relative = builder.AddNamedSystem("seen_tool", BlockSystem(RelativeTool(order), period))
    builder.Connect(tool_pose, relative.GetInputPort("tool_pose"))
    builder.Connect(frame_jet, relative.GetInputPort("frame_jet"))
    return relative.GetOutputPort("relative_pose")


def add_framed_point(
    builder: DiagramBuilder,
    own: Manifold,
    manifold_point: OutputPort,
    frame_jet: OutputPort,
    period: float,
) -> OutputPort:
    """Add a manifold point with the motion of its frame, and return both for the law.

    Args:
        builder: Builder of the diagram.
        own: The manifold in its frame.
        manifold_point: Its point in the frame.
        frame_jet: Derivatives of the frame up to the manifold's order.
        period: Sampling time [s].
    """
    block = FramedPoint(FramedLayout(own.layout))
    framed = builder.AddNamedSystem("framed_point", BlockSystem(block, period))
    builder.Connect(manifold_point, framed.GetInputPort("manifold_point"))
    builder.Connect(frame_jet, framed.GetInputPort("frame_jet"))
    return framed.GetOutputPort("framed_point")
