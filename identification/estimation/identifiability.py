"""What a motion tells about which parameters, by singular values of the scaled regressor.

The weighted information matrix is scaled to columns of length 1, ``X = A diag(s)``, so that units
do not matter. Directions of the scaled parameters along which A is zero change no torque at all:
what takes part in them cannot be told apart. Directions with small singular values are hardly
seen.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr, svd
from scipy.sparse.csgraph import connected_components

from pfsc_drake.errors import InputError

# of the largest singular value; those below are zero but for rounding
_ZERO = 1e-8
# part that a parameter has in a direction, from which on it counts
_TAKES_PART = 1e-4
_MOST_NAMES = 12
# relative standard deviation, above which Sec. C.2 calls a parameter badly identifiable
BADLY = 0.15
# correlation from which on parameters move together, and how many of them are told
_TOGETHER, _MOST_PARTNERS = 0.7, 3
# how much better a parameter were known if the others were, to blame them
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
    """Return singular values of an information matrix that tells all parameters apart.

    Args:
        X: Weighted, shape (rows, n_b).
        b: Weighted torques, shape (rows,).
        names: Names of the parameters.
        what: Whose they are, for messages.

    Raises:
        InputError: If there are fewer rows than parameters, or parameters that have no effect or
            cannot be told apart; says which.
    """
    rows = int(np.count_nonzero(np.any(X != 0.0, axis=1)))
    scale = np.linalg.norm(X, axis=0)
    seen = scale > 0.0
    Q, R = qr(X[:, seen] / scale[seen], mode="economic", check_finite=False)
    U, values, Vt = svd(R)
    known = values > _ZERO * values.max(initial=1.0)
    if not seen.all() or not known.all() or rows < len(names):
        blind = Vt[np.count_nonzero(known) :].T
        seen_names = [name for name, is_seen in zip(names, seen, strict=True) if is_seen]
        lines = []
        if not seen.all():
            without = [name for name in names if name not in seen_names]
            lines.append(f"without effect on the torques: {_listed(without)}")
        groups = _groups(blind, seen_names)
        if groups:
            lines.append("cannot be told apart: " + "; ".join(map(_listed, groups)))
        raise InputError(
            f"{what}: the motion does not excite all {len(names)} parameters ({rows} torques "
            f"count); {'; '.join(lines)}; must move so that each changes the torques in its own way"
        )
    return Factors(scale, values, Vt.T, U.T @ (Q.T @ b))


def _groups(blind: np.ndarray, names: Sequence[str]) -> list[list[str]]:
    """Return parameters that take part in blind directions, those together that are mixed."""
    if not blind.shape[1]:
        return []
    projector = blind @ blind.T
    part = np.flatnonzero(np.diag(projector) > _TAKES_PART**2)
    linked = np.abs(projector[np.ix_(part, part)]) > _TAKES_PART**2
    _, label = connected_components(linked, directed=False)
    return [[names[i] for i in part[label == group]] for group in np.unique(label)]


def _listed(names: Sequence[str]) -> str:
    more = len(names) - _MOST_NAMES
    return ", ".join(names[:_MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


@dataclass(frozen=True)
class WeakParameter:
    """A parameter that is badly identifiable, and why.

    Attributes:
        name: Name of the parameter.
        relative_deviation: Standard deviation by magnitude.
        relative_deviation_alone: The same if all others were known.
        torque_share: Largest RMS of the torques that the parameter makes, in units of the
            noise of a torque as measured in the same joint.
        joint: Name of that joint.
        partners: Names of parameters that it moves together with, the closest first.
    """

    name: str
    relative_deviation: float
    relative_deviation_alone: float
    torque_share: float
    joint: str
    partners: tuple[str, ...]

    @property
    def reason(self) -> str:
        """Why, in words."""
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
        noise: Standard deviation of one torque as measured, shape (N,).
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
