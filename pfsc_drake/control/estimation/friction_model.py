"""Friction of known coefficients, as a law overcomes it."""

import casadi as ca
import numpy as np

from pfsc_drake.control.checks import checked_vector
from pfsc_drake.errors import InputError


def friction_torque(coulomb: ca.SX, viscous: ca.SX, velocity: ca.SX, smoothing: float) -> ca.SX:
    """Return ``tau_f = f_c tanh(v / v_s) + f_v v``, shape (N, 1) [Nm or N].

    That is (2.41) with a smooth step: a torque that jumped with the sign of a measured velocity
    would rattle drives at rest.

    Args:
        coulomb: ``f_c``, shape (N, 1) [Nm or N].
        viscous: ``f_v``, shape (N, 1) [Nm s/rad or N s/m].
        velocity: v of the drives, shape (N, 1) [rad/s or m/s].
        smoothing: ``v_s`` [rad/s or m/s].
    """
    return coulomb * ca.tanh(velocity / smoothing) + viscous * velocity


def friction_model_function(
    coulomb: np.ndarray, viscous: np.ndarray, smoothing: float
) -> ca.Function:
    """Return :func:`friction_torque` of known coefficients as a function of numbers.

    Args:
        coulomb: ``f_c``, shape (N,) [Nm or N], none negative.
        viscous: ``f_v``, shape (N,) [Nm s/rad or N s/m], none negative.
        smoothing: ``v_s`` [rad/s or m/s], positive.

    Returns:
        ``velocity -> friction_torque``, each (N,).

    Raises:
        InputError: If a number is out of range.
    """
    size = np.size(coulomb)
    f_c, f_v = (
        checked_vector("friction model", name, values, size, positive=False)
        for name, values in (("coulomb", coulomb), ("viscous", viscous))
    )
    require_smoothing(smoothing)
    v = ca.SX.sym("velocity", size)
    tau = friction_torque(ca.SX(f_c), ca.SX(f_v), v, smoothing)
    return ca.Function("friction", [v], [ca.densify(tau)], ["velocity"], ["friction_torque"])


def require_smoothing(smoothing: float) -> None:
    """Refuse a velocity of smoothing that is not positive.

    Raises:
        InputError: If so.
    """
    if not 0.0 < smoothing < np.inf:
        raise InputError(f"smoothing = {smoothing}: must be a positive number")
