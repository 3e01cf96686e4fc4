"""Reaction of a wrench on the tool: the opposite wrench on the workpiece."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values

_POSE = 12


class Reaction(Block):
    """Reaction wrench on a workpiece at the origin C of its frame.

    A process at the tool point ``y_t`` applies ``[f, mu]`` to the tool. By Newton's third law it
    applies ``[-f, -mu]`` to the workpiece at the same point. At the frame's origin ``p_WC`` this
    is::

        f_C = -f,   mu_C = -mu - (y_t - p_WC) x f

    Ports:
        wrench (input): ``[f, mu]`` on the tool at the tool point, world axes, shape (6,) [N, Nm].
        tool_pose (input): ``[y_t, R_e by rows]`` in the world, shape (12,) [m, 1].
        workpiece_pose (input): ``[p_WC, R_WC by rows]`` in the world, shape (12,) [m, 1].
        reaction (output): ``[f_C, mu_C]`` on the workpiece, world axes, shape (6,) [N, Nm].
    """

    def __init__(self) -> None:
        self.inputs = {
            "wrench": Port(6, "N, Nm"),
            "tool_pose": Port(_POSE, "m, 1"),
            "workpiece_pose": Port(_POSE, "m, 1"),
        }
        self.outputs, self.states = {"reaction": Port(6, "N, Nm")}, {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """Return all outputs, and the inner values."""
        f, mu = u.wrench[:3], u.wrench[3:]
        arm = u.tool_pose[:3] - u.workpiece_pose[:3]
        return {"reaction": ca.vertcat(-f, -mu - ca.cross(arm, f))}
