"""What wrong masses do to a compliance whose forces are observed instead of measured.

An observer of rate L believes the inertia of a coordinate too large by ``dM``; it takes what
that inertia does not need for a force, ``f_hat = L / (s + L) (f + dM y'')``. Behind an impedance
``m y'' + d y' + k y = f_hat`` that a loop makes true, the coordinate obeys::

    ((m - dM L / (s + L)) s^2 + d s + k) y = L / (s + L) f

so that the inertia that is believed too much is missing from the virtual mass, the more, the
faster the observer is. By the criterion of Routh the polynomial of third order is stable up to the
``dM`` of :func:`bearable_inertia_error`.
"""

import numpy as np


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
