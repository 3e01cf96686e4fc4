"""Identifiability of parameters from a motion, by singular values of the scaled regressor.

The weighted information matrix is scaled to columns of length 1, ``X = A diag(s)``, so that units
do not matter. Directions of the scaled parameters along which A is zero change no torque: their
parameters cannot be distinguished. Directions with small singular values are nearly invisible.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr, svd
from scipy.sparse.csgraph import connected_components

from pfsc_drake.errors import InputError

# of the largest singular value; smaller ones are zero up to rounding
_ZERO = 1e-8
# least component of a parameter in a direction that counts
_TAKES_PART = 1e-4
_MOST_NAMES = 12
# relative standard deviation above which Sec. C.2 calls a parameter badly identifiable
BADLY = 0.15
# correlation from which on parameters are reported as partners, and their largest number
_TOGETHER, _MOST_PARTNERS = 0.7, 3
# least improvement by known other parameters that makes them the reason
_BLAME = 3.0


@dataclass(frozen=True, eq=False)
class Factors:
    """Singular values of the scaled information matrix, ``X = U diag(values) V' diag(scale)``.

    Attributes:
        scale: Lengths of the columns of X, shape (n_b,).
        values: Singular values, falling, shape (n_b,).
        directions: V, columns of length 1, shape (n_b, n_b).
        right_side: ``U' b``, shape (n_b,).
    """

    scale: np.ndarray
    values: np.ndarray
    directions: np.ndarray
    right_side: np.ndarray

    @property
    def condition(self) -> float:
        """Largest by smallest singular value."""
        return float(self.values[0] / self.values[-1])

    def solution(self) -> np.ndarray:
        """Return the least-squares solution, shape (n_b,)."""
        solution: np.ndarray = self.directions @ (self.right_side / self.values) / self.scale
        return solution

    def inverse(self) -> np.ndarray:
        """Return ``(X' X)^-1``, shape (n_b, n_b)."""
        root = self.directions / self.values / self.scale[:, None]
        return root @ root.T


def factorize(X: np.ndarray, b: np.ndarray, names: Sequence[str], what: str) -> Factors:
    """Return singular values of an information matrix that distinguishes all parameters.

    Args:
        X: Weighted, shape (rows, n_b).
        b: Weighted torques, shape (rows,).
        names: Names of the parameters.
        what: Subject of the messages.

    Raises:
        InputError: If there are fewer rows than parameters, or parameters have no effect or cannot
            be distinguished; names them.
    """
    rows = int(np.count_nonzero(np.any(X != 0.0, axis=1)))
    scale = np.linalg.norm(X, axis=0)
    effective = scale > 0.0
    Q, R = qr(X[:, effective] / scale[effective], mode="economic", check_finite=False)
    U, values, Vt = svd(R)
    known = values > _ZERO * values.max(initial=1.0)
    if not effective.all() or not known.all() or rows < len(names):
        blind = Vt[np.count_nonzero(known) :].T
        effective_names = [
            name for name, is_effective in zip(names, effective, strict=True) if is_effective
        ]
        lines = []
        if not effective.all():
            without = [name for name in names if name not in effective_names]
            lines.append(f"without effect on the torques: {_join_names(without)}")
        groups = _groups(blind, effective_names)
        if groups:
            lines.append("cannot be distinguished: " + "; ".join(map(_join_names, groups)))
        raise InputError(
            f"{what}: the motion does not excite all {len(names)} parameters ({rows} torques "
            f"count); {'; '.join(lines)}; must move so that each changes the torques in its own way"
        )
    return Factors(scale, values, Vt.T, U.T @ (Q.T @ b))


def _groups(blind: np.ndarray, names: Sequence[str]) -> list[list[str]]:
    """Return groups of parameters that are mixed in directions without effect."""
    if not blind.shape[1]:
        return []
    projector = blind @ blind.T
    part = np.flatnonzero(np.diag(projector) > _TAKES_PART**2)
    linked = np.abs(projector[np.ix_(part, part)]) > _TAKES_PART**2
    _, label = connected_components(linked, directed=False)
    return [[names[i] for i in part[label == group]] for group in np.unique(label)]


def _join_names(names: Sequence[str]) -> str:
    more = len(names) - _MOST_NAMES
    return ", ".join(names[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


@dataclass(frozen=True)
class WeakParameter:
    """A badly identifiable parameter, with the reason.

    Attributes:
        name: Name of the parameter.
        relative_deviation: Standard deviation divided by the magnitude.
        relative_deviation_alone: The same if all others were known.
        torque_share: Largest RMS of the parameter's torques, in units of the noise of a measured
            torque in the same joint.
        joint: Name of that joint.
        partners: Names of correlated parameters, the closest first.
    """

    name: str
    relative_deviation: float
    relative_deviation_alone: float
    torque_share: float
    joint: str
    partners: tuple[str, ...]

    @property
    def reason(self) -> str:
        """Reason in words."""
        reasons = []
        if self.torque_share < 1.0:
            reasons.append(
                f"its torque is at most {self.torque_share:.2g} times the noise ({self.joint})"
            )
        gain = self.relative_deviation / self.relative_deviation_alone
        if gain > _BLAME or not reasons:
            others = ", ".join(self.partners) or "many others, a little with each"
            reasons.append(
                f"moves together with {others} (were all others known: "
                f"{_percent(self.relative_deviation_alone)})"
            )
        return "; ".join(reasons)


def _percent(ratio: float) -> str:
    return "more than 1000 %" if ratio > 10.0 else f"{100.0 * ratio:.2g} %"


def weak_parameters(
    matrix: np.ndarray,
    weights: np.ndarray,
    noise: np.ndarray,
    values: np.ndarray,
    covariance: np.ndarray,
    names: Sequence[str],
    joint_names: Sequence[str],
) -> list[WeakParameter]:
    """Return the parameters that are badly identifiable, the worst first.

    Args:
        matrix: ``Y_b``, shape (K, N, n_b).
        weights: Weights of the torques, shape (K, N).
        noise: Standard deviation of one measured torque, shape (N,).
        values: Values of the parameters, shape (n_b,).
        covariance: Covariance of the parameters, shape (n_b, n_b).
        names: Names of the parameters.
        joint_names: N names.
    """
    deviation = np.sqrt(np.diag(covariance))
    relative = deviation / np.maximum(np.abs(values), np.finfo(float).tiny)
    correlation = np.abs(covariance / np.outer(deviation, deviation))
    np.fill_diagonal(correlation, 0.0)
    weak = []
    for i in np.argsort(-relative):
        if relative[i] <= BADLY:
            break
        column = matrix[:, :, i]
        share = np.sqrt(np.mean(column**2, axis=0)) * abs(values[i]) / noise
        alone = relative[i] / (deviation[i] * np.linalg.norm(column * weights))
        closest = np.argsort(-correlation[i])[:_MOST_PARTNERS]
        partners = tuple(names[k] for k in closest if correlation[i, k] >= _TOGETHER)
        j = int(np.argmax(share))
        weak.append(
            WeakParameter(
                names[i],
                float(relative[i]),
                float(alone),
                float(share[j]),
                joint_names[j],
                partners,
            )
        )
    return weak
