"""What a wrench on a tool does to whoever holds the workpiece that it comes from."""

from typing import Any

import casadi as ca

from pfsc_drake.blocks.block import Block, Port, Values

_POSE = 12


class Reaction(Block):
    """The wrench on a workpiece whose opposite a tool bears, at the origin C of its frame.

    A process at the tool point ``y_t`` puts ``[f, mu]`` on the tool. By Newton's third law the
    workpiece bears ``[-f, -mu]`` at the same point, which is at its frame's origin ``p_WC``::

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
