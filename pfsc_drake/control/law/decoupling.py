"""The one place that inverts a decoupling matrix."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack

from pfsc_drake.errors import InputError


class DecouplingSolution(NamedTuple):
    """Solution of ``A x = rhs`` and how far A is from singular.

    Attributes:
        x: Highest joint derivative, shape (N,); NaN where A is singular.
        rcond: Estimated reciprocal condition number of A (1-norm) in [0, 1].
    """

    x: np.ndarray
    rcond: float


@dataclass(frozen=True)
class DecouplingInverse:
    """Solves ``A q^(r) = v - b`` and judges the conditioning of A.

    Attributes:
        min_rcond: Smallest reciprocal condition number (1-norm, rows in m and
            rad) at which the solution may be used.
    """

    min_rcond: float = 1e-3

    def __post_init__(self) -> None:
        if not 0.0 < self.min_rcond < 1.0:
            raise InputError(f"min_rcond: {self.min_rcond}; must lie between 0 and 1")

    def solve(self, A: np.ndarray, rhs: np.ndarray) -> DecouplingSolution:
        """Solve the linear system by LU factorization.

        Args:
            A: Decoupling matrix, shape (N, N).
            rhs: Right-hand side, shape (N,).
        """
        lu, _, x, info = lapack.dgesv(A, rhs)
        if info != 0:
            return DecouplingSolution(np.full(len(rhs), np.nan), 0.0)
        rcond, _ = lapack.dgecon(lu, lapack.dlange("1", A))
        return DecouplingSolution(x, float(rcond))

    def accepts(self, solution: DecouplingSolution) -> bool:
        """Return whether the solution may be used."""
        # written so that NaN is refused
        return solution.rcond >= self.min_rcond
