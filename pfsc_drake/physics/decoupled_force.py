"""A wrench that slows a robot down along its path and does nothing else."""

import casadi as ca

from pfsc_drake.control.law.actuation import joint_jets
from pfsc_drake.control.manifolds.path import PathManifold, path_coordinates
from pfsc_drake.robot.robot_model import RobotModel


def decoupled_force_function(robot: RobotModel, manifold: PathManifold) -> ca.Function:
    """Return the wrench whose effect on the slow dynamics (3.68) is along ``eta`` alone.

    An external wrench w accelerates the virtual output by ``A (D_E + D_M)^-1 J_g' w``.
    A force along the tangent moves the other coordinates too, through the arm's inertia;
    the wrench returned here moves ``eta`` only, and its force along the tangent is 1 N.

    Args:
        robot: A robot with six axes.
        manifold: A path with orientation.

    Returns:
        CasADi function ``(q, manifold_point) -> [force, torque]`` at the tool point, world
        axes, shapes (6,), (size,) and (6,).
    """
    n = robot.dimension
    q, rate = ca.SX.sym("q", n), ca.SX.sym("rate", n)
    point = ca.SX.sym("manifold_point", manifold.layout.size)
    path = manifold.geometry(point)
    y, R_e = robot.tool_pose(joint_jets([q, rate]))
    output = path_coordinates(y, R_e, path)
    A = ca.jacobian(ca.vertcat(*[x.coefficients[1] for x in output]), rate)
    spin = R_e.coefficients[1] @ R_e.coefficients[0].T
    twist = ca.vertcat(y.coefficients[1], ca.inv_skew(spin))
    J_g = ca.jacobian(twist, rate)
    tau = (robot.mass_matrix(q) + ca.diag(robot.D_M)) @ ca.solve(A, ca.SX.eye(n)[:, 0])
    wrench = ca.solve(J_g.T, tau)
    tangent = path.position[1] / ca.norm_2(path.position[1])
    wrench = wrench / ca.dot(wrench[:3], tangent)
    return ca.Function("decoupled_force", [q, point], [ca.densify(wrench)])
