"""What the joint between flange and tool bears, as a function."""

import casadi as ca

from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.tool_load import ToolLoad, predicted_load


def tool_reaction_function(robot: RobotModel, load: ToolLoad) -> ca.Function:
    """Return what the joint between flange and tool exerts on the tool.

    By Newton and Euler on the tool alone: the opposite of :func:`predicted_load` and of the
    wrench that acts on the tool, moved to the sensor's origin.

    Args:
        robot: The robot.
        load: Everything behind the sensor.

    Returns:
        ``(q, v, a, wrench) -> reaction``: link coordinates, velocities, accelerations, each
        (N,); wrench ``[force, torque]`` at the tool point in world axes, shape (6,); reaction
        ``[torque, force]`` on the tool in S, shape (6,) [Nm, N].
    """
    n = robot.dimension
    q, v, a = (ca.SX.sym(name, n) for name in "qva")
    wrench = ca.SX.sym("wrench", 6)
    joints = [Jet.from_derivatives([q[i], v[i], a[i]]) for i in range(n)]
    predicted, R_WS = predicted_load(robot, load, joints)
    force, torque = R_WS.T @ wrench[:3], R_WS.T @ wrench[3:]
    total = predicted + ca.vertcat(force, torque + ca.cross(ca.SX(load.p_ST), force))
    reaction = -ca.vertcat(total[3:], total[:3])
    return ca.Function(
        "tool_reaction",
        [q, v, a, wrench],
        ca.cse([ca.densify(reaction)]),
        ["q", "v", "a", "wrench"],
        ["reaction"],
    )
