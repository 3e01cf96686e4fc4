"""What wrenches on the links of an arm mean in its joints."""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.blocks.block import Block, Port, Values
from pfsc_drake.blocks.cases import any_of, where
from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.newton_euler import points_on_links
from pfsc_drake.robot.tool_load import joint_torque_function

# index of a link, and where on it [m], shape (3,)
Points = Sequence[tuple[int, np.ndarray]]


class LinkForces(Block):
    """Tells where wrenches on links act and what they mean in the joints.

    Forces and torques act **on the robot**; ``tau_ext = sum_k J_k(q_J)^T wrench_k`` is what they
    mean at the joints, with the sign of (2.65a), ``D_E q'' + n_E = tau_J + tau_ext``.

    Ports:
        joint_state (input): ``[q_J, v_J, q_M, v_M]``, shape (4N,).
        wrenches (input): ``[force, torque]`` at each of K points, world axes, shape (6K,)
            [N, Nm].
        points (output): Where the points are in the world, shape (3K,) [m].
        tau_ext (output): External torques on the link side, shape (N,) [Nm or N].

    Args:
        chain: The arm, N joints.
        points: The K points.
    """

    def __init__(self, chain: SerialChain, points: Points) -> None:
        self._n, size = chain.dimension, len(points)
        self._points = link_points_function(chain, points)
        self._torque = link_torque_function(chain, points)
        self.inputs = {
            "joint_state": Port(4 * self._n, "rad, rad/s or m, m/s"),
            "wrenches": Port(6 * size, "N, Nm"),
        }
        self.outputs = {"points": Port(3 * size, "m"), "tau_ext": Port(self._n, "Nm or N")}
        self.states = {}

    def output(self, x: Values, u: Values, t: Any) -> dict[str, Any]:
        """See :class:`Block`."""
        q_J = u.joint_state[: self._n]
        tau_ext = self._torque(q_J, u.wrenches)
        acting = any_of(u.wrenches != 0.0)
        return {
            "points": self._points(q_J),
            "tau_ext": where(acting, tau_ext, ca.DM.zeros(self._n)),
        }


@once_per_content()
def link_points_function(chain: SerialChain, points: Points) -> ca.Function:
    """Return ``q -> points``, where K points of links are in the world, as numbers.

    Args:
        chain: The arm, N joints.
        points: Of each the index of its link and where it is in that link's frame [m].

    Returns:
        Function of q, shape (N,), to positions one after the other, shape (3K,) [m].
    """
    q = ca.SX.sym("q", chain.dimension)
    still = [jets.constant(q[i], 1) for i in range(chain.dimension)]
    places = [place.coefficients[0] for place in points_on_links(chain, still, points)]
    return ca.Function("link_points", [q], [ca.densify(ca.vertcat(*places))], ["q"], ["points"])


@once_per_content()
def link_torque_function(chain: SerialChain, points: Points) -> ca.Function:
    """Return ``(q, wrenches) -> tau_ext``, the sum of ``J_k^T wrench_k``, see (2.11).

    ``J_k`` is the geometric Jacobian of the k-th point; joints beyond its link bear nothing.

    Args:
        chain: The arm, N joints.
        points: Of each the index of its link and where it is in that link's frame [m].

    Returns:
        Function of q, shape (N,), and of wrenches ``[force, torque]`` on the arm at K points,
        world axes, shape (6K,) [N, Nm], to torques or forces of shape (N,) [Nm or N].
    """
    n = chain.dimension
    q, wrenches = ca.SX.sym("q", n), ca.SX.sym("wrenches", 6 * len(points))
    tau_ext = ca.SX(n, 1)
    for (link, point), wrench in zip(points, ca.vertsplit(wrenches, 6), strict=True):
        joints = link + 1
        tau_ext[:joints] += joint_torque_function(chain.up_to(link, point))(q[:joints], wrench)
    results = ca.cse([ca.densify(tau_ext)])
    return ca.Function("link_torque", [q, wrenches], results, ["q", "wrenches"], ["tau_ext"])
