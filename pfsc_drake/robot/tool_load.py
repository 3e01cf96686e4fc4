"""Load of the tool on a force/torque sensor, and wrenches at the tool point.

A wrench is ``[force, torque]``, shape (6,) [N, Nm]. Frames: S of the sensor, whose
origin is its reference point; T of the tool point; W world.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from pfsc_drake.compiled.content import once_per_content
from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import RobotModel

_SMALLEST_NORM = 1e-300


@dataclass(frozen=True)
class ToolLoad:
    """Everything behind the sensor as one rigid body.

    Attributes:
        mass: Mass m [kg].
        p_SC: Centre of mass in S [m], shape (3,).
        I_C: Inertia about the centre of mass, axes of S [kg m^2], shape (3, 3).
        R_ST: Orientation of the tool frame in S, shape (3, 3).
        p_ST: Tool point in S [m], shape (3,).
        gravity: Gravitational acceleration in world axes [m/s^2], shape (3,).
    """

    mass: float
    p_SC: np.ndarray
    I_C: np.ndarray
    R_ST: np.ndarray
    p_ST: np.ndarray
    gravity: np.ndarray


def predicted_load(robot: RobotModel, load: ToolLoad, q: Sequence[Jet]) -> tuple[ca.SX, ca.SX]:
    """Return the sensor's reading due to the tool alone, and the sensor's orientation.

    ``f = m (g - a_C)``, ``tau = p_SC x f - h'``: the load of the tool on the sensor, about
    its origin. The rate of the angular momentum about the centre of mass is
    ``S(h') = A - A^T`` with ``A = R_WS^T R_WS'' E_C``, ``E_C = tr(I_C) / 2 - I_C``, which is
    ``I_C w' + w x I_C w``.

    Args:
        robot: The robot.
        load: The tool.
        q: Joint coordinates, jets of order 2.

    Returns:
        Wrench in S, shape (6, 1), and ``R_WS``, shape (3, 3).
    """
    y_t, R_e = robot.tool_pose(q)
    R_WS = R_e @ ca.SX(load.R_ST.T)
    y_C = y_t + R_WS @ ca.SX(load.p_SC - load.p_ST)
    orientation = R_WS.coefficients[0]
    force = load.mass * (orientation.T @ (load.gravity - y_C.derivative(2)))
    E_C = np.trace(load.I_C) / 2.0 * np.eye(3) - load.I_C
    A = orientation.T @ R_WS.derivative(2) @ E_C
    torque = ca.cross(ca.SX(load.p_SC), force) - ca.inv_skew(A - A.T)
    return ca.vertcat(force, torque), orientation


def dead_band(vector: ca.SX, width: float) -> ca.SX:
    """Return a vector shortened by a width, zero if it is shorter; continuous in the vector."""
    if width == 0.0:
        return vector
    norm = ca.norm_2(vector)
    return vector * ca.fmax(norm - width, 0.0) / ca.fmax(norm, _SMALLEST_NORM)


@once_per_content()
def joint_torque_function(robot: RobotModel) -> ca.Function:
    """Return ``(q, wrench) -> tau_ext = J_g^T wrench``, (2.11), as a function of numbers.

    The wrench acts at the tool point and is in world axes; ``tau_ext`` is the gradient of
    its power by the joint velocities, shape (N,) [Nm or N].
    """
    n = robot.dimension
    q, v, wrench = ca.SX.sym("q", n), ca.SX.sym("v", n), ca.SX.sym("wrench", 6)
    y_t, R_e = robot.tool_pose([Jet([q[i], v[i]]) for i in range(n)])
    w_WT = ca.inv_skew(R_e.coefficients[1] @ R_e.coefficients[0].T)
    power = ca.dot(wrench[:3], y_t.coefficients[1]) + ca.dot(wrench[3:], w_WT)
    tau_ext = ca.densify(ca.gradient(power, v))
    return ca.Function("joint_torque", [q, wrench], ca.cse([tau_ext]), ["q", "wrench"], ["tau_ext"])
