"""Least squares for the torques of each joint beside each other."""

from dataclasses import dataclass

import numpy as np

from identification.estimation.information import SLOW

# below this part of the largest, an eigenvalue is zero but for rounding
_RANK = 1e-12


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Parameters and what is left, linear in factors s of the torques of N joints.

    With ``tau_j`` in the rows of joint j as column j of C and the weighted regressor X, the
    parameters are ``(X' X)^-1 X' C s``, and the squares that are left are ``s' M s`` with
    ``M = C' C - C' X (X' X)^-1 X' C``.

    Attributes:
        left_over: M in units of the noise, shape (N, N).
        parameters: ``(X' X)^-1 X' C``, shape (n_b, N).
        deviation: Standard deviations of the parameters, shape (n_b,); infinite for those that
            torques do not tell apart.
        sizes: RMS of the torque that a parameter of one makes, in units of the noise, shape (n_b,).
        freedom: Torques that count less parameters.
    """

    left_over: np.ndarray
    parameters: np.ndarray
    deviation: np.ndarray
    sizes: np.ndarray
    freedom: int

    @classmethod
    def of(
        cls, matrix: np.ndarray, v: np.ndarray, tau: np.ndarray, noise: np.ndarray
    ) -> "NormalEquations":
        """Return those of a motion of K instants; torques of slow joints do not count.

        Args:
            matrix: ``Y_b``, shape (K, N, n_b).
            v: Velocities, shape (K, N).
            tau: Torques, shape (K, N).
            noise: Their standard deviations, shape (N,).
        """
        samples, joints = tau.shape
        fastest = np.abs(v).max(axis=0)
        used = (np.abs(v) >= SLOW * fastest) & (fastest > 0.0)
        weight = used / noise
        X = (matrix * weight[..., None]).reshape(samples * joints, -1)
        lengths = np.linalg.norm(X, axis=0)
        scale = np.where(lengths > 0.0, lengths, 1.0)
        X /= scale
        values, vectors = np.linalg.eigh(X.T @ X)
        known = values > _RANK * max(float(values[-1]), np.finfo(float).tiny)
        root = vectors[:, known] / np.sqrt(values[known])
        weighted = tau * weight
        right = np.einsum("kjp,kj->pj", X.reshape(samples, joints, -1), weighted)
        parameters = root @ (root.T @ right)
        blind = np.linalg.norm(vectors[:, ~known], axis=1) > np.sqrt(_RANK)
        deviation = np.linalg.norm(root, axis=1) / scale
        return cls(
            np.diag(np.sum(weighted**2, axis=0)) - right.T @ parameters,
            parameters / scale[:, None],
            np.where(blind, np.inf, deviation),
            lengths / np.sqrt(samples),
            max(int(used.sum()) - int(known.sum()), 1),
        )
