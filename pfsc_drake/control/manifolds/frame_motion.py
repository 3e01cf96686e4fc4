"""Motion of a manifold's frame: from joints, by differences of poses, or from a plan."""

import math
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.control.manifolds.moving_frame import (
    POSE_SIZE,
    FramedLayout,
    frame_jets,
    frame_size,
    frame_vector,
    relative_to,
)
from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import RobotModel


class FlangeFrame(Block):
    """Motion of a robot's tool frame, from the motion of its joints.

    Ports:
        joint_jet (input): Joint coordinates and derivatives 1..r by rows, shape ((r + 1) N,)
            [rad or m, per s, ..].
        frame_jet (output): Derivatives 0..k of ``[p_WC, R_WC by rows]``, see :func:`frame_jets`,
            shape (12 (k + 1),).

    Args:
        robot: The controller's model of the robot.
        relative_degree: ``r`` of its law.
        order: ``k``, at most r.
        placement: Nominal pose of its base, ``X_WB`` times the inverse of the base pose in the
            robot's model: ``[p, R by rows]``, shape (12,); the model's pose if omitted.
        highest: Highest derivative that is evaluated, the others being zero; by default all.
    """

    def __init__(
        self,
        robot: RobotModel,
        relative_degree: int,
        order: int,
        placement: np.ndarray | None = None,
        highest: int | None = None,
    ) -> None:
        self._highest = order if highest is None else min(highest, order)
        shift = np.append(np.zeros(3), np.eye(3)) if placement is None else placement
        self._motion = flange_motion_function(robot, order)
        self._size = robot.dimension * (order + 1)
        self._p, self._R = ca.DM(shift[:3]), ca.DM(np.reshape(shift[3:], (3, 3)))
        joints = Port(robot.dimension * (relative_degree + 1), "rad or m, per s, ..")
        self.inputs, self.states = {"joint_jet": joints}, {}
        self.outputs = {"frame_jet": Port(frame_size(order), "m, 1, per s, ..")}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        rows = ca.vertsplit(self._motion(u.joint_jet[: self._size]), POSE_SIZE)
        placed = [_rotate_pose(self._R, row) for row in rows]
        placed[0] = ca.vertcat(placed[0][:3] + self._p, placed[0][3:])
        padding = [ca.DM.zeros(POSE_SIZE)] * (len(placed) - 1 - self._highest)
        return {"frame_jet": ca.vertcat(*placed[: self._highest + 1], *padding)}


@once_per_content()
def flange_motion_function(robot: RobotModel, order: int) -> ca.Function:
    """Return a tool frame's motion as a function of the joints'.

    Args:
        robot: The robot.
        order: Highest derivative k.

    Returns:
        ``joint_jet -> frame_jet``, shapes (N (k + 1),) and (12 (k + 1),).
    """
    n = robot.dimension
    joints = ca.SX.sym("joint_jet", n * (order + 1))
    rows = ca.vertsplit(joints, n)
    q = [Jet.from_derivatives([row[i] for row in rows]) for i in range(n)]
    frame = ca.densify(frame_vector(*robot.tool_pose(q)))
    return ca.Function("flange_motion", [joints], ca.cse([frame]), ["joint_jet"], ["frame_jet"])


def _rotate_pose(R: Any, pose: Any) -> Any:
    """Return ``R p`` and ``R R_WC`` of a pose or of a derivative of one, shape (12,)."""
    rotation = R @ ca.reshape(pose[3:], 3, 3).T
    return ca.vertcat(R @ pose[:3], ca.vec(rotation.T))


class DifferencedFrame(Block):
    """Motion of a frame by differences of its measured poses, for comparison.

    Ports:
        frame_jet (input): Motion of the frame; only the pose is used, shape (12 (k + 1),).
        differenced (output): The pose, and its backward differences in place of derivatives; the
            i-th lags by i / 2 ticks.

    State:
        ``poses`` of the last k ticks, the oldest first, shape (12 k,).

    Args:
        order: Highest derivative k, of which those above ``highest`` are taken to be zero.
        highest: Highest difference.
        period: Sampling time [s].
    """

    def __init__(self, order: int, highest: int, period: float) -> None:
        self._order, self._highest, self._period = order, highest, period
        size = frame_size(order)
        self.inputs, self.outputs = {"frame_jet": Port(size)}, {"differenced": Port(size)}
        self.states = {"poses": POSE_SIZE * max(order, 1)}

    def initial(self, u: Values, t: Any) -> dict[str, Any]:
        """Return the initial state: a frame at rest."""
        return {"poses": ca.repmat(u.frame_jet[:POSE_SIZE], max(self._order, 1), 1)}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        poses = [*ca.vertsplit(x.poses, POSE_SIZE), u.frame_jet[:POSE_SIZE]][::-1]
        rows = [poses[0]]
        for k in range(1, self._order + 1):
            weights = [(-1) ** i * math.comb(k, i) / self._period**k for i in range(k + 1)]
            known = k <= self._highest
            difference = sum(w * pose for w, pose in zip(weights, poses, strict=False))
            rows.append(difference if known else ca.DM.zeros(POSE_SIZE))
        return {"differenced": ca.vertcat(*rows)}

    def update(self, x: Values, u: Values, y: Values, t: Any) -> dict[str, Any]:
        """Return the state at the next tick; omitted parts stay."""
        return {"poses": ca.vertcat(x.poses[POSE_SIZE:], u.frame_jet[:POSE_SIZE])}


class PlannedFrame(Block):
    """Frame of a measured pose with the derivatives of its plan.

    Ports:
        frame_jet (input): Motion of the frame; only the pose is used, shape (12 (k + 1),).
        planned (input): Derivatives 0..k of the plan, shape (12 (k + 1),).
        mixed (output): The measured pose, and the plan's derivatives.

    Args:
        order: Highest derivative k, of which those above ``highest`` are taken to be zero.
        highest: Highest derivative from the plan.
    """

    def __init__(self, order: int, highest: int) -> None:
        self._planned_size = POSE_SIZE * (min(highest, order) + 1)
        size = frame_size(order)
        self.inputs = {"frame_jet": Port(size), "planned": Port(size)}
        self.outputs, self.states = {"mixed": Port(size)}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        planned = u.planned[POSE_SIZE : self._planned_size]
        padding = ca.DM.zeros(u.planned.shape[0] - self._planned_size)
        return {"mixed": ca.vertcat(u.frame_jet[:POSE_SIZE], planned, padding)}


class RelativeTool(Block):
    """Pose of a tool relative to a moving frame.

    Ports:
        tool_pose (input): ``[y_t, R_e by rows]`` in the world, shape (12,) [m, 1].
        frame_jet (input): See :func:`frame_jets`.
        relative_pose (output): ``[y_C, R_Ce by rows]`` in the frame, shape (12,) [m, 1].

    Args:
        order: Highest derivative in ``frame_jet``.
    """

    def __init__(self, order: int) -> None:
        self.inputs = {"tool_pose": Port(POSE_SIZE, "m, 1"), "frame_jet": Port(frame_size(order))}
        self.outputs, self.states = {"relative_pose": Port(POSE_SIZE, "m, 1")}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        tool, frame = frame_jets(u.tool_pose), frame_jets(u.frame_jet[:POSE_SIZE])
        return {"relative_pose": frame_vector(*relative_to(*frame, *tool))}


class FramedPoint(Block):
    """Point of a manifold together with the motion of the frame that carries it.

    Ports:
        manifold_point (input): Point of the manifold in its frame.
        frame_jet (input): See :func:`frame_jets`.
        framed_point (output): Laid out by :class:`FramedLayout`.

    Args:
        layout: The output's layout.
    """

    def __init__(self, layout: FramedLayout) -> None:
        self.inputs = {
            "manifold_point": Port(layout.own.size),
            "frame_jet": Port(frame_size(layout.order)),
        }
        self.outputs, self.states = {"framed_point": Port(layout.size)}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        return {"framed_point": ca.vertcat(u.manifold_point, u.frame_jet)}
