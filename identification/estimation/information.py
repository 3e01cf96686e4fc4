"""Overdetermined linear system (2.75) of a motion and its measured torques."""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from identification.estimation.friction_terms import FrictionTerm, FrictionTerms
from identification.measurement.periods import AveragedMotion
from identification.model.base import BaseParameters
from identification.model.regressor import Regressor
from identification.model.subject import Subject
from pfsc_drake.errors import InputError

# of a joint's largest velocity: below, it is unknown whether it sticks or slips
SLOW = 0.03
# of a joint's velocity limit (or of 1 rad/s or m/s): below, it stands still
_STILL = 1e-3


@dataclass(frozen=True, eq=False)
class StoredMotion:
    """A motion of N joints at K instants, as in Sec. 2.5.2, with torques, without single periods.

    Attributes:
        q: Positions [rad or m], shape (K, N).
        v: Velocities [rad/s or m/s], shape (K, N).
        a: Accelerations [rad/s^2 or m/s^2], shape (K, N).
        tau: Torques [Nm or N], shape (K, N).
        torque_variance: Variance of one measured torque, shape (N,).
        mean_torque_variance: Variance of ``tau``, shape (N,); smaller if it is a mean.
        t: Times [s], shape (K,); None if unknown.
    """

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    tau: np.ndarray
    torque_variance: np.ndarray
    mean_torque_variance: np.ndarray
    t: np.ndarray | None = None


MeasuredMotion = StoredMotion | AveragedMotion


@dataclass(frozen=True, eq=False)
class Information:
    """Linear system of a motion with n_b parameters; K instants, N joints.

    Attributes:
        matrix: ``Y_b`` at each instant, shape (K, N, n_b); stacked, the information matrix X
            (2.76).
        torques: ``tau_d`` at each instant (2.77) [Nm or N], shape (K, N).
        used: Which torques count, shape (K, N): those of moving joints.
        variance: Variance of the torques, the diagonal of Upsilon in (2.80), shape (N,).
        base: Base parameters of the columns.
        still: Whether a joint stands still throughout, shape (N,).
    """

    matrix: np.ndarray
    torques: np.ndarray
    used: np.ndarray
    variance: np.ndarray
    base: BaseParameters
    still: np.ndarray

    @property
    def weights(self) -> np.ndarray:
        """Factors of the rows, ``Upsilon^(-1/2)``; 0 if not used; shape (K, N)."""
        return self.used / np.sqrt(self.variance)

    def weighted(self) -> tuple[np.ndarray, np.ndarray]:
        """Return X and b_tau, weighted, shapes (K N, n_b) and (K N,)."""
        weights = self.weights
        X = self.matrix * weights[:, :, None]
        return X.reshape(-1, X.shape[2]), (self.torques * weights).ravel()


def information(
    regressor: Regressor,
    base: BaseParameters,
    motion: MeasuredMotion,
    friction: FrictionTerms | None = None,
    slow: float = SLOW,
) -> Information:
    """Return the linear system of a motion.

    Near a reversal a joint may stick, and its friction has any value up to ``f_c``. Therefore the
    torques of a joint do not count while it moves slowly. A joint that stands still throughout, up
    to noise, is treated as fixed.

    Args:
        regressor: Regressor of the robot.
        base: Its base parameters, of the same columns.
        motion: The motion.
        friction: Terms beside Coulomb and viscous friction.
        slow: Part of a joint's largest velocity below which its torques do not count.

    Raises:
        InputError: If the motion belongs to another robot, the base parameters to another
            regressor, a variance is not positive, or ``slow`` is not in [0, 1).
    """
    subject = regressor.subject
    if list(base.full_names) != list(regressor.names):
        raise InputError(
            f"{subject.name}: base parameters of {len(base.full_names)} parameters, the regressor "
            f"has {regressor.size}; both must be of the same"
        )
    if not 0.0 <= slow < 1.0:
        raise InputError(f"slow = {slow!r}; must be in [0, 1)")
    n = subject.dimension
    torques, variance = np.asarray(motion.tau), np.asarray(motion.mean_torque_variance)
    if torques.shape != np.shape(motion.q) or variance.shape != (n,):
        raise InputError(
            f"{subject.name}: tau of shape {torques.shape}, its variance of shape "
            f"{variance.shape}; must be {np.shape(motion.q)} and ({n},)"
        )
    if not np.isfinite(torques).all():
        raise InputError(f"{subject.name}: tau has values that are not finite")
    if not np.all((variance > 0.0) & np.isfinite(variance)):
        j = int(np.argmin((variance > 0.0) & np.isfinite(variance)))
        raise InputError(
            f"{subject.name}: variance of the torque of {subject.joint_names[j]} = "
            f"{variance[j]:g}; must be positive and finite, as of measured torques"
        )
    fastest, still = np.abs(motion.v).max(axis=0), joints_at_rest(subject, motion.v)
    v, a = np.where(still, 0.0, motion.v), np.where(still, 0.0, motion.a)
    matrix = base.reduce(regressor.matrix(motion.q, v, a))
    if friction is not None and friction.terms:
        friction.check_size(n)
        matrix = np.concatenate([matrix, friction.columns(v)], axis=2)
        base = friction.extend(base, subject.joint_units)
    used = (np.abs(v) >= slow * fastest) & ~still
    return Information(matrix, torques, used, variance, base, still)


def joints_at_rest(subject: Subject, v: np.ndarray) -> np.ndarray:
    """Return which joints stand still throughout up to noise, shape (N,).

    Args:
        subject: The robot.
        v: Joint velocities [rad/s or m/s], shape (K, N).
    """
    limit = np.where(np.isfinite(subject.velocity_limit), subject.velocity_limit, 1.0)
    return np.asarray(np.abs(v).max(axis=0) <= _STILL * limit)


_REMEMBERED = 128  # terms with stored products


class Products(NamedTuple):
    """Contribution of a further column to the normal equations.

    Attributes:
        column: Column of one joint, weighted, shape (K,).
        columns: Its products with the columns of the system, shape (n_b,).
        torques: Its product with the torques.
    """

    column: np.ndarray
    columns: np.ndarray
    torques: float


class FurtherColumns:
    """A weighted linear system that can be extended by friction terms; K instants, N joints.

    Attributes:
        X: Weighted information matrix, shape (K N, n_b).
        b: Weighted torques, shape (K N,).
        by_joint: X, shape (K, N, n_b).
        torques: b, shape (K, N).
        v: Velocities of the joints [rad/s or m/s], shape (K, N).
        names: Names of the n_b parameters.
    """

    def __init__(self, system: Information, v: np.ndarray) -> None:
        """Weight a system.

        Args:
            system: The linear system.
            v: Velocities of its joints [rad/s or m/s], shape (K, N).
        """
        shape = system.torques.shape
        self.X, self.b = system.weighted()
        self.by_joint = self.X.reshape(*shape, -1)
        self.torques = self.b.reshape(shape)
        self.v, self.names = np.asarray(v), system.base.short_names
        self._weights = system.weights
        self.products = lru_cache(maxsize=_REMEMBERED)(self._products)

    def column(self, term: FrictionTerm) -> np.ndarray:
        """Return the weighted column of a term in its joint, shape (K,)."""
        column: np.ndarray = term.column(self.v[:, term.joint]) * self._weights[:, term.joint]
        return column

    def _products(self, term: FrictionTerm) -> Products:
        column, joint = self.column(term), term.joint
        return Products(
            column, self.by_joint[:, joint].T @ column, float(self.torques[:, joint] @ column)
        )
