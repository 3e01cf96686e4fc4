"""Numerical base parameters: combinations of parameters that the torques depend on (2.74)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.model.regressor import Regressor
from pfsc_drake.errors import InputError

# least part of a column outside the span of others for it to be independent of them: models are
# written with six digits, and smaller parts have no measurable torque
_INDEPENDENT = 3e-5
# of the largest column of the same kind of parameter; below, it is zero up to such rounding
_ZERO = 3e-5
# relative error of a coefficient that is an integer or zero
_ROUNDING = 1e-9
# postures for the comparison of columns, per parameter
_SAMPLES_PER_PARAMETER = 4
# slides without limits move that far [m], revolute joints half a turn to both sides
_STROKE = 1.0
# priority of the parameters as base parameters, by groups, as in Mayeda et al.
_PREFERENCE = (
    ("Izz", "mx", "my", "Ixx", "Ixy", "Ixz", "Iyz", "m_q", "m_y"),
    ("I_M", "f_c", "f_v"),
    ("mz", "Iyy", "m"),
)


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """A smallest set of parameters, each a linear combination of all, that the torques depend on.

    ``Y rho = Y_b rho_b`` with ``rho_b = K_b rho`` and the columns ``Y_b = Y[:, indices]``.

    Attributes:
        indices: Indices of the base parameters among all, shape (n_b,).
        projection: ``K_b``, shape (n_b, n); has ones at ``indices``.
        full_names: Names of the n parameters.
        full_units: Units of the n parameters.
    """

    indices: np.ndarray
    projection: np.ndarray
    full_names: list[str]
    full_units: list[str]

    @property
    def rank(self) -> int:
        """Number of base parameters n_b."""
        return len(self.indices)

    @property
    def names(self) -> list[str]:
        """Combination of each base parameter, ``link_2.Izz + 0.3481 link_3.m + ...``."""
        return [combination(row, self.full_names, first=i) for row, i in self._rows()]

    @property
    def short_names(self) -> list[str]:
        """Leading parameter of each combination."""
        return [self.full_names[i] for i in self.indices]

    @property
    def units(self) -> list[str]:
        """Units of the base parameters."""
        return [self.full_units[i] for i in self.indices]

    def values(self, parameters: np.ndarray) -> np.ndarray:
        """Return ``rho_b = K_b rho``, shape (n_b,).

        Args:
            parameters: ``rho``, shape (n,).
        """
        return self.projection @ parameters

    def reduce(self, Y: np.ndarray) -> np.ndarray:
        """Return ``Y_b`` of (2.74), shape (..., n_b).

        Args:
            Y: Regression matrices, shape (..., n).
        """
        return Y[..., self.indices]

    def _rows(self) -> list[tuple[np.ndarray, int]]:
        return [(row, int(i)) for row, i in zip(self.projection, self.indices, strict=True)]


def base_parameters(regressor: Regressor, seed: int = 0) -> BaseParameters:
    """Return base parameters of a robot, from the regression matrices of random motions.

    Columns that depend on others are found by orthogonalization, and their parameters are added to
    those that they depend on. Moments of inertia about the joint axis, first moments across and
    friction are preferred to masses, so that the combinations resemble (B.4).

    Args:
        regressor: Regressor of the robot.
        seed: Seed of the random motions.

    Raises:
        InputError: If no parameter has an effect.
    """
    X = regressor.matrix(*random_motion(regressor, seed)).reshape(-1, regressor.size)
    X[:, _without_effect(X, regressor.names)] = 0.0
    order = sorted(range(regressor.size), key=lambda i: _preference(regressor.names[i]))
    independent = np.sort(_independent(X, order))
    if independent.size == 0:
        raise InputError(f"{regressor.subject.name}: no parameter has an effect on the torques")
    projection = np.linalg.lstsq(X[:, independent], X, rcond=None)[0]
    norms = np.linalg.norm(X, axis=0)
    share = np.abs(projection) * norms[independent, None]
    # coefficients below the error of the combination are zero
    error = np.linalg.norm(X - X[:, independent] @ projection, axis=0)
    projection[share <= np.maximum(_ROUNDING * norms, error)] = 0.0
    projection[:, independent] = np.eye(independent.size)
    return BaseParameters(independent, projection, list(regressor.names), list(regressor.units))


def random_motion(regressor: Regressor, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return independent random positions, velocities and accelerations.

    Args:
        regressor: Regressor of the robot.
        seed: Seed of the random numbers.

    Returns:
        Arrays (K, N) with enough rows for all parameters, of the order of 1 in rad (m) and s.
        Positions are within the limits of a joint if it has some.
    """
    subject, random = regressor.subject, np.random.default_rng(seed)
    stroke = np.where(np.array(subject.joint_units) == "rad", np.pi, _STROKE)
    lower, upper = np.clip(subject.position_limits.T, -stroke, stroke)
    shape = (_SAMPLES_PER_PARAMETER * regressor.size, subject.dimension)
    v, a = random.normal(size=(2, *shape))
    return random.uniform(lower, upper, shape), v, a


def combination(row: np.ndarray, names: Sequence[str], first: int | None = None) -> str:
    """Return a linear combination in words, ``link_2.Izz + 0.3481 link_3.m``.

    Args:
        row: Coefficients, shape (n,).
        names: Names of the n parameters.
        first: Leading parameter; by default the first with a coefficient.
    """
    used = np.flatnonzero(row).tolist()
    if first is not None:
        used = [first, *(i for i in used if i != first)]
    text = ""
    for i in used:
        size = f"{abs(row[i]):.4g} "
        size = "" if size == "1 " else size
        sign = ("-" if row[i] < 0.0 else "") if not text else (" - " if row[i] < 0.0 else " + ")
        text += f"{sign}{size}{names[i]}"
    return text


def _without_effect(X: np.ndarray, names: Sequence[str]) -> np.ndarray:
    """Return a flag for columns that are zero compared to those of the same kind, shape (n,)."""
    norms, kinds = np.linalg.norm(X, axis=0), np.array([name.split(".")[1] for name in names])
    largest = {kind: norms[kinds == kind].max() for kind in np.unique(kinds)}
    return norms <= _ZERO * np.array([largest[kind] for kind in kinds])


def _preference(name: str) -> int:
    kind = name.split(".")[1]
    return next(rank for rank, group in enumerate(_PREFERENCE) if kind in group)


def _independent(X: np.ndarray, order: Sequence[int]) -> np.ndarray:
    """Return the indices of columns that do not depend on those before them in an order."""
    norms = np.linalg.norm(X, axis=0)
    directions = np.empty((0, X.shape[0]))
    independent = []
    for i in order:
        if norms[i] == 0.0:
            continue
        rest = X[:, i] / norms[i]
        for _ in range(2):  # twice, against rounding
            rest = rest - directions.T @ (directions @ rest)
        if (length := np.linalg.norm(rest)) > _INDEPENDENT:
            independent.append(i)
            directions = np.vstack([directions, rest / length])
    return np.array(independent, dtype=int)
