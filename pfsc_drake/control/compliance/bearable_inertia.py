"""Which inertia a compliance bears, below a force sensor or believed too large.

A sensor feels ``-M_L y''`` of what hangs below it, beside what pushes. What of it is not taken
off is answered by the impedance, ``m y'' = f - M_L y''``, and a loop that makes this true closes
a circle around the acceleration itself, in which nothing falls off with the frequency but what
lags: its gain is ``M_L / m``. A time that is lost in the circle, and one tick always is, makes it
unstable above

    M_L / m  =  1 / |G(j w)|  where  G(s) = exp(-s T_d) omega / (s + omega)  has turned by 180 deg

with the lag of velocity servos ``omega``, infinite where torques are commanded: then that is one.

Without a sensor, an observer of rate L believes the inertia of a coordinate too large by ``dM``;
it takes what that inertia does not need for a force, ``f_hat = L / (s + L) (f + dM y'')``. Behind
an impedance ``m y'' + d y' + k y = f_hat`` that a loop makes true, the coordinate obeys::

    ((m - dM L / (s + L)) s^2 + d s + k) y = L / (s + L) f

so that the inertia that is believed too much is missing from the virtual mass, the more, the
faster the observer is. By the criterion of Routh the polynomial of third order is stable up to the
``dM`` of :func:`bearable_inertia_error`.
"""

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from pfsc_drake.jets import Jet
from pfsc_drake.robot.robot_model import RobotModel
from pfsc_drake.robot.tool_load import ToolLoad


def load_inertia(
    robot: RobotModel, load: ToolLoad, q: np.ndarray, added: float = 0.0
) -> np.ndarray:
    """Return the inertia of a load in joint coordinates, ``M_L(q)``, shape (N, N).

    Args:
        robot: The robot.
        load: What hangs below the sensor.
        q: Joint coordinates, shape (N,).
        added: A mass at the tool point beside it [kg].
    """
    n = robot.dimension
    v = ca.SX.sym("v", n)
    y_t, R_e = robot.tool_pose([Jet([ca.SX(float(q[i])), v[i]]) for i in range(n)])
    R_WS = R_e @ ca.SX(load.R_ST.T)
    y_C = y_t + R_WS @ ca.SX(load.p_SC - load.p_ST)
    w = ca.inv_skew(R_WS.coefficients[0].T @ R_WS.coefficients[1])
    energy = load.mass * ca.sumsqr(y_C.coefficients[1]) + ca.bilin(ca.SX(load.I_C), w, w)
    energy += added * ca.sumsqr(y_t.coefficients[1])
    return np.asarray(ca.evalf(ca.hessian(energy / 2.0, v)[0]).full())


def carried_share(inertia: np.ndarray, A: np.ndarray, masses: np.ndarray) -> tuple[float, int]:
    """Return the largest ``M_L / m`` in any direction, and the coordinate with the most part in it.

    Args:
        inertia: ``M_L`` in joint coordinates, shape (N, N), see :func:`load_inertia`.
        A: Of the coordinates, ``y' = A q'``, shape (m, N).
        masses: Of the impedance [kg or kg m^2], shape (m,), infinite for what does not yield.

    Returns:
        Zero where nothing yields.
    """
    yielding = np.flatnonzero(np.isfinite(masses))
    if not yielding.size:
        return 0.0, 0
    to_joints = np.linalg.pinv(A)[:, yielding] / np.sqrt(masses[yielding])
    values, vectors = np.linalg.eigh(to_joints.T @ inertia @ to_joints)
    return float(values[-1]), int(yielding[np.argmax(np.abs(vectors[:, -1]))])


def bearable_share(delay: float, bandwidth: float = np.inf) -> float:
    """Return the ``M_L / m`` at which the circle becomes unstable.

    Args:
        delay: ``T_d`` in it, positive [s].
        bandwidth: ``omega`` of velocity servos [rad/s].
    """
    if np.isinf(bandwidth):
        return 1.0
    turned = brentq(lambda w: w * delay + np.arctan(w / bandwidth) - np.pi, 0.0, np.pi / delay)
    return float(np.hypot(1.0, turned / bandwidth))


def bearable_inertia_error(mass: float, damping: float, stiffness: float, rate: float) -> float:
    """Return how much too large an inertia may be believed before the compliance is unstable.

    ``dM < m + d / L - m k / (k + d L)``; the tool swings at ``sqrt((k + d L) / m)`` there.

    Args:
        mass: ``m`` [kg or kg m^2], positive.
        damping: ``d`` [N s/m or Nm s/rad]; with ``k`` above zero it is positive.
        stiffness: ``k`` [N/m or Nm/rad]; infinite for a coordinate that does not yield.
        rate: L of the observer [1/s], positive.

    Returns:
        [kg or kg m^2]; infinite where nothing yields.
    """
    if np.isinf(stiffness):
        return np.inf
    lost = mass * stiffness / (stiffness + damping * rate) if stiffness else 0.0
    return mass + damping / rate - lost


def bearable_mass_error(inertia: np.ndarray, A: np.ndarray, bearable: np.ndarray) -> float:
    """Return the relative error of all masses that a compliance bears.

    Args:
        inertia: Of the links in joint coordinates, ``D_E``, shape (N, N).
        A: Of the coordinates, ``y' = A q'``, shape (m, N).
        bearable: :func:`bearable_inertia_error` of each coordinate, shape (m,).

    Returns:
        Relative; infinite where nothing yields.
    """
    yielding = np.isfinite(bearable)
    if not yielding.any():
        return np.inf
    to_joints = np.linalg.pinv(A)[:, yielding] / np.sqrt(bearable[yielding])
    return float(1.0 / np.linalg.eigvalsh(to_joints.T @ inertia @ to_joints)[-1])
