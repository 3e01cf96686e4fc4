"""The wrench at the tool that explains torques in the joints."""

import casadi as ca
import numpy as np

from pfsc_drake.control.compliance.tool_load import dead_band, joint_torque_function
from pfsc_drake.errors import InputError
from pfsc_drake.robot.robot_model import RobotModel

_POSITION_ONLY = 3


def tool_wrench_function(
    robot: RobotModel, damping: float = 0.0, dead_bands: tuple[float, float] = (0.0, 0.0)
) -> ca.Function:
    """Return ``(q, tau_ext) -> wrench``, the inverse of ``tau_ext = J_g^T wrench`` (2.11).

    ``wrench = (J J^T + damping^2 I)^-1 J tau_ext``: without damping the inverse, or where there
    are more joints than components the least squares fit; with damping what a singular posture
    does not tell is taken for zero instead of being blown up. Arms of three joints tell a force,
    and are taken to bear no torque. Both parts are shortened by a dead band.

    Args:
        robot: The robot, N joints, three or at least six.
        damping: Of the inverse, beside the singular values of J in m and rad.
        dead_bands: Widths for force [N] and torque [Nm].

    Returns:
        Function of shapes (N,), (N,) to (6,) [N, Nm], at the tool point, world axes.

    Raises:
        InputError: If a number is out of range, or the robot has too few joints.
    """
    n = robot.dimension
    if n != _POSITION_ONLY and n < 6:
        raise InputError(
            f"forces on the tool from the torques in {n} joints: cannot be told; needs 3 joints "
            "for a force, 6 or more for force and torque"
        )
    for name, value in (("damping", damping), ("dead bands", min(dead_bands))):
        if not 0.0 <= value < np.inf:
            raise InputError(f"{name} = {value}: must be zero or positive")
    q, tau, wrench = ca.SX.sym("q", n), ca.SX.sym("tau_ext", n), ca.SX.sym("wrench", 6)
    told = 3 if n == _POSITION_ONLY else 6
    J = ca.jacobian(joint_torque_function(robot)(q, wrench), wrench)[:, :told].T
    found = ca.ldl_solve(J @ tau, *ca.ldl(J @ J.T + damping**2 * ca.SX.eye(told)))
    found = ca.vertcat(found, ca.SX(6 - told, 1))
    result = ca.vertcat(dead_band(found[:3], dead_bands[0]), dead_band(found[3:], dead_bands[1]))
    return ca.Function(
        "tool_wrench", [q, tau], ca.cse([ca.densify(result)]), ["q", "tau_ext"], ["wrench"]
    )
