"""Resonances of elastic joints, which decide what law suits a sampling time."""

import numpy as np

from pfsc_drake.robot.robot_model import RobotModel, mass_function


def joint_resonances(robot: RobotModel, q_J: np.ndarray) -> np.ndarray:
    """Return the undamped resonances of motors against links, see (3.69).

    Their squares are the eigenvalues of ``K_s (D_E^-1(q_J) + D_M^-1)``.

    Args:
        robot: A robot with elastic joints.
        q_J: Joint coordinates, shape (N,).

    Returns:
        Angular frequencies in increasing order [rad/s], shape (N,).
    """
    D_E = np.array(mass_function(robot)(q_J))
    compliance = np.linalg.inv(D_E) + np.diag(1.0 / robot.D_M)
    # K^1/2 C K^1/2 has the eigenvalues of K C and is symmetric
    root = np.sqrt(robot.K_s)
    return np.sqrt(np.linalg.eigvalsh(root[:, None] * compliance * root))
