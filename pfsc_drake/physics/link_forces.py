"""What wrenches on the links of an arm mean in its joints."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from pfsc_drake import jets
from pfsc_drake.control.compliance.tool_load import joint_torque_function
from pfsc_drake.robot.serial.chain import SerialChain
from pfsc_drake.robot.serial.newton_euler import points_on_links

# index of a link, and where on it [m], shape (3,)
Points = Sequence[tuple[int, np.ndarray]]


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
