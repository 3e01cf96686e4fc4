"""The one place that inverts a decoupling matrix."""

import math
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack

from pfsc_drake.errors import InputError

# of a posture's coordinate, by which part of itself it must move with the outputs at rest
_LEAST_SHARE = 0.1


class Restraint(NamedTuple):
    """How fast joints may become by what they do beside the outputs.

    Attributes:
        rest: Highest joint derivative with which they come to rest, shape (N,).
        velocity: Of the joints, shape (N,); None where the highest derivative is one.
        settling: ``a_2``: in the end joints move with ``(x - rest) / a_2``.
        speeds: Largest of the joints, shape (N,), infinite for any.
    """

    rest: np.ndarray
    velocity: np.ndarray | None
    settling: float
    speeds: np.ndarray


class Spare(NamedTuple):
    """What joints beyond the number of outputs are to do.

    Attributes:
        wish: Highest joint derivative that is wanted, shape (N,).
        scale: ``S`` with ``S S' = W^-1``, shape (N, N), of the weight W by which deviations
            from the wish are judged; None for the identity.
        slope: Of one more coordinate ``c`` of the joints, ``h = dc/dq``, shape (N,); None for
            none.
        rate: ``h q^(r)`` that this coordinate is to have.
        restraint: By what all of this is held back; None for nothing.
    """

    wish: np.ndarray
    scale: np.ndarray | None = None
    slope: np.ndarray | None = None
    rate: float = 0.0
    restraint: Restraint | None = None


class DecouplingSolution(NamedTuple):
    """Solution of ``A x = rhs`` and how far A is from singular.

    Attributes:
        x: Highest joint derivative, shape (N,); NaN where A is singular.
        rcond: Reciprocal condition number of A in [0, 1]: estimated in the 1-norm; where A has
            more columns than rows, or damping may set in, ``m / (|A| |A^+|)`` (Frobenius), which
            changes as smoothly as A does.
        residual: ``rhs - A x``, shape (m,), that damping near a singular A leaves; None where
            nothing is damped.
        rest: The same without what joints are to do beside the outputs, as far as they are held
            back, shape (N,); None where they are not.
    """

    x: np.ndarray
    rcond: float
    residual: np.ndarray | None = None
    rest: np.ndarray | None = None


@dataclass(frozen=True)
class DecouplingInverse:
    """Solves ``A q^(r) = v - b`` and judges the conditioning of A, shape (m, N) with N >= m.

    With as many joints as outputs that is one linear system. With more, it is the solution
    that deviates least from a wish w, weighted by W::

        x = w + W^-1 A' (A W^-1 A')^-1 (rhs - A w)

    and then, within what leaves the outputs alone, the one that gives one more coordinate of the
    joints the rate that is wanted of it. It fades out where it hardly moves without the outputs.

    Restraint: with ``x_0`` the solution by which joints come to rest as far as the outputs let
    them, everything else ends in joint velocities ``u = (x - x_0) / a_2`` beside those ``q_y'``
    that the outputs take. What is used is ``x_0 + s (x - x_0)`` with the largest ``s <= 1`` for
    which ``|q_y'| + s |u|`` stays below every joint's largest speed. So a posture far away, or a
    coordinate that hardly moves alone, asks for no more than joints can do.

    Damping: where the reciprocal condition number c is below ``damped_below = c_0``, the system
    is solved with ``A W^-1 A' + lambda^2 I``, ``lambda^2 = (c_0^2 - c^2) |A S|^2`` (Frobenius),
    which keeps x bounded through a singular posture; what the outputs miss is told.

    Attributes:
        min_rcond: Smallest reciprocal condition number (rows in m and rad) at which the solution
            may be used, unless it is damped.
        damped_below: Reciprocal condition number below which the solution is damped; 0 for never.
    """

    min_rcond: float = 1e-3
    damped_below: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 < self.min_rcond < 1.0:
            raise InputError(f"min_rcond: {self.min_rcond}; must lie between 0 and 1")
        if self.damped_below != 0.0 and not self.min_rcond < self.damped_below < 1.0:
            raise InputError(
                f"damped_below: {self.damped_below}; must be 0, or lie between min_rcond = "
                f"{self.min_rcond:g} and 1"
            )

    def solve(
        self, A: np.ndarray, rhs: np.ndarray, spare: Spare | None = None
    ) -> DecouplingSolution:
        """Solve the linear system.

        Args:
            A: Decoupling matrix, shape (m, N).
            rhs: Right-hand side, shape (m,).
            spare: What joints beyond the number of outputs are to do; needed if N > m.
        """
        if spare is not None or self.damped_below:
            return self._solve_next_to(A, rhs, spare or Spare(np.zeros(A.shape[1])))
        lu, _, x, info = lapack.dgesv(A, rhs)
        if info != 0:
            return DecouplingSolution(np.full(len(rhs), np.nan), 0.0)
        rcond, _ = lapack.dgecon(lu, lapack.dlange("1", A))
        return DecouplingSolution(x, float(rcond))

    def accepts(self, solution: DecouplingSolution) -> bool:
        """Return whether the solution may be used."""
        # written so that NaN is refused
        return solution.rcond >= self.min_rcond or solution.residual is not None

    def _solve_next_to(self, A: np.ndarray, rhs: np.ndarray, spare: Spare) -> DecouplingSolution:
        """Solve a system with a wish, or with damping."""
        wish, scale = spare.wish, spare.scale
        Q, R = _factors(A if scale is None else A @ scale)
        # conditioning is that of the outputs, whatever the weight
        rcond = _rcond(A, R if scale is None else _factors(A)[1])
        if rcond < self.damped_below:
            return self._damped(A, rhs, rcond, spare)
        z, info = lapack.dtrtrs(R, _sides(A, rhs, spare), trans=1)
        if info != 0:
            return DecouplingSolution(np.full(len(wish), np.nan), 0.0)
        x, rest, _ = _restrained(Q, Q @ z, spare)
        return DecouplingSolution(x, rcond, rest=rest)

    def _damped(
        self, A: np.ndarray, rhs: np.ndarray, rcond: float, spare: Spare
    ) -> DecouplingSolution:
        """Solve with damping; of a matrix that is not finite nothing is known."""
        B = A if spare.scale is None else A @ spare.scale
        norm = float(np.linalg.norm(B))
        if not math.isfinite(norm + float(rhs.sum())):
            return DecouplingSolution(np.full(A.shape[1], np.nan), math.nan)
        square = (self.damped_below**2 - rcond**2) * norm**2
        gram = B @ B.T
        gram[np.diag_indices(len(rhs))] += square
        z = lapack.dposv(gram, _sides(A, rhs, spare))[1]
        x, rest, share = _restrained(_factors(B)[0], B.T @ z, spare)
        missed = square * z[:, 0] if rest is None else square * (z[:, :2] @ [share, 1.0 - share])
        return DecouplingSolution(x, rcond, missed, rest)


def scale_of(weight: np.ndarray) -> np.ndarray:
    """Return ``S`` with ``S S' = W^-1`` of a symmetric positive definite W, shape (N, N).

    Args:
        weight: ``W``, shape (N, N); if it is not positive definite, S is of NaN.
    """
    upper, info = lapack.dpotrf(weight)
    return lapack.dtrtri(upper)[0] if info == 0 else np.full_like(weight, np.nan)


def free_torque(A: np.ndarray, torque: np.ndarray, scale: np.ndarray | None = None) -> np.ndarray:
    """Return the part of joint torques that does no work on the outputs, shape (N,).

    That is ``N' tau`` with ``N = I - W^-1 A' (A W^-1 A')^-1 A``.

    Args:
        A: Decoupling matrix, shape (m, N) with N > m.
        torque: ``tau``, shape (N,).
        scale: ``S`` with ``S S' = W^-1``, shape (N, N); None for the identity.
    """
    if scale is None:
        Q = _factors(A)[0]
        return torque - Q @ (Q.T @ torque)
    Q, scaled = _factors(A @ scale)[0], scale.T @ torque
    return np.linalg.solve(scale.T, scaled - Q @ (Q.T @ scaled))


def _factors(B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return ``Q, R`` of ``B' = Q R``; Q has orthonormal columns, shapes (N, m) and (m, m)."""
    qr, tau, _, _ = lapack.dgeqrf(B.T)
    Q, _, _ = lapack.dorgqr(qr, tau)
    return Q, qr[: len(B)]


def _rcond(B: np.ndarray, R: np.ndarray) -> float:
    """Return ``m / (|B| |R^-1|)``, Frobenius, of ``B' = Q R``; 0 if B is singular or not finite."""
    inverse, info = lapack.dtrtri(R)
    if info != 0:
        return 0.0
    square = float(np.vdot(B, B)) * float(np.vdot(inverse * _upper(len(R)), inverse))
    return len(R) / math.sqrt(square) if 0.0 < square < math.inf else 0.0


@cache
def _upper(size: int) -> np.ndarray:
    """Return ones on and above the diagonal; below, LAPACK keeps other things."""
    return np.triu(np.ones((size, size)))


def _next_to(Q: np.ndarray, y: np.ndarray, spare: Spare) -> np.ndarray:
    """Return ``wish + S y``, with the rate of the spare coordinate where it can move alone.

    Args:
        Q: Orthonormal columns that span the rows of ``A S``, shape (N, m).
        y: What the outputs ask for beyond the wish, shape (N,).
        spare: The wish.
    """
    scale = spare.scale
    x = spare.wish + (y if scale is None else scale @ y)
    if spare.slope is None:
        return x
    whole = spare.slope if scale is None else scale.T @ spare.slope
    alone = whole - Q @ (Q.T @ whole)
    square = float(alone @ alone)
    # continuous: a coordinate that can hardly move alone is given up
    divisor = max(square, _LEAST_SHARE**2 * float(whole @ whole))
    if divisor == 0.0:
        return x
    step = alone * ((spare.rate - float(spare.slope @ x)) / divisor)
    return x + (step if scale is None else scale @ step)


def _sides(A: np.ndarray, rhs: np.ndarray, spare: Spare) -> np.ndarray:
    """Return what is left to the outputs beside the wish, the rest and nothing, as columns."""
    sides, restraint = [rhs - A @ spare.wish], spare.restraint
    if restraint is not None:
        sides.append(rhs - A @ restraint.rest)
        if restraint.velocity is not None:
            sides.append(A @ restraint.velocity)
    return np.column_stack(sides)


def _restrained(
    Q: np.ndarray, y: np.ndarray, spare: Spare
) -> tuple[np.ndarray, np.ndarray | None, float]:
    """Return the solution, the one of joints that come to rest, and the share beyond that.

    Args:
        Q: Orthonormal columns that span the rows of ``A S``, shape (N, m).
        y: Of each side of :func:`_sides`, as columns.
        spare: What joints are to do.
    """
    x, restraint, scale = _next_to(Q, y[:, 0], spare), spare.restraint, spare.scale
    if restraint is None:
        return x, None, 1.0
    others = y[:, 1:] if scale is None else scale @ y[:, 1:]
    rest = restraint.rest + others[:, 0]
    taken = np.abs(rest if restraint.velocity is None else others[:, 1])
    beyond = np.abs(x - rest) / restraint.settling
    left = np.maximum(restraint.speeds - taken, 0.0)
    fast = beyond > left
    share = float(np.min(left[fast] / beyond[fast])) if fast.any() else 1.0
    return x if share == 1.0 else rest + share * (x - rest), rest, share
