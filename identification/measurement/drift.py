"""Whether friction changed while a robot was measured."""

from dataclasses import dataclass

import numpy as np

from identification.measurement.periods import AveragedMotion
from pfsc_drake.errors import InputError

_SURE = 5.0  # standard deviations


@dataclass(frozen=True, eq=False)
class FrictionTrend:
    """By how much friction grew from the first to the last period that was averaged; N joints.

    Attributes:
        coulomb: Change of ``f_c`` [Nm or N], shape (N,).
        viscous: Change of ``f_v`` [Nm s/rad or N s/m], shape (N,).
        coulomb_deviation: Standard deviation of ``coulomb``, shape (N,).
        viscous_deviation: Standard deviation of ``viscous``, shape (N,).
        significance: Of both changes together, in standard deviations (root of the Mahalanobis
            distance from 0), shape (N,).
    """

    coulomb: np.ndarray
    viscous: np.ndarray
    coulomb_deviation: np.ndarray
    viscous_deviation: np.ndarray
    significance: np.ndarray

    @property
    def changes(self) -> np.ndarray:
        """Whether friction of a joint certainly changed, shape (N,)."""
        return self.significance > _SURE


def friction_trend(motion: AveragedMotion) -> FrictionTrend:
    """Return how friction changed from period to period.

    What differs between the periods of a motion that repeats itself is no inertia and no
    gravity. The torques of period p are fitted, with the same means for all of them, by::

        tau_p(t) = tau(t) + (p - p_mean) (c sign(v(t)) + d v(t))

    and noise, that is taken for white; a coloured disturbance makes the deviations too small.

    Args:
        motion: P periods, P at least 2.

    Raises:
        InputError: If a joint does not move.
    """
    periods, count, joints = motion.tau_periods.shape
    steps = np.arange(periods) - 0.5 * (periods - 1)
    weight = float(steps @ steps)
    slope = np.einsum("p,pkn->kn", steps, motion.tau_periods)
    found, deviations, sure = np.empty((joints, 2)), np.empty((joints, 2)), np.empty(joints)
    for j, name in enumerate(motion.joint_names):
        v = motion.v[:, j]
        shape = np.column_stack([np.sign(v), v])
        normal = shape.T @ shape
        if np.linalg.matrix_rank(shape) < shape.shape[1]:
            raise InputError(f"{name} does not move to and fro; must, to tell how friction changes")
        x = np.linalg.solve(normal, shape.T @ slope[:, j]) / weight
        around = motion.tau_periods[..., j] - motion.tau[:, j] - np.outer(steps, shape @ x)
        variance = np.sum(around**2) / ((periods - 1) * count - shape.shape[1])
        covariance = variance / weight * np.linalg.inv(normal)
        found[j], deviations[j] = x, np.sqrt(np.diag(covariance))
        # without any noise nothing is left to compare with
        distance = x @ normal @ x * weight
        sure[j] = np.sqrt(distance / variance) if variance > 0.0 else (np.inf if x.any() else 0.0)
    found, deviations = (periods - 1) * found, (periods - 1) * deviations
    return FrictionTrend(found[:, 0], found[:, 1], deviations[:, 0], deviations[:, 1], sure)
