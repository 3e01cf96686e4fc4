"""The one place that inverts a decoupling matrix."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import casadi as ca
import numpy as np

from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.blocks.linear_algebra import cholesky, householder, solve, solve_upper
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.rules import Parameters, Range

# of a posture's coordinate, by which part of itself it must move with the outputs at rest
_LEAST_SHARE = 0.1


class Restraint(NamedTuple):
    """How fast joints may become by what they do beside the outputs.

    Attributes:
        rest: Highest joint derivative with which they come to rest, shape (N,).
        velocity: Velocity of the joints, shape (N,); None where the highest derivative is one.
        settling: ``a_2``: in the end joints move with ``(x - rest) / a_2``.
        speeds: Largest of the joints, shape (N,), infinite for any.
        to_ends: Largest upwards and downwards with which they come to rest before their ends,
            shape (N, 2); None for any.
    """

    rest: ca.SX
    velocity: ca.SX | None
    settling: float
    speeds: np.ndarray
    to_ends: ca.SX | None = None


class Spare(NamedTuple):
    """What joints beyond the number of outputs are to do.

    Attributes:
        desired: Highest joint derivative that is wanted, shape (N,).
        scale: Upper triangular ``S`` with ``S S' = W^-1``, shape (N, N), of the weight W by which
            deviations from it are judged, see :func:`scale_of`; None for the identity.
        slope: Slope of one more coordinate ``c`` of the joints, ``h = dc/dq``, shape (N,); None for
            none.
        rate: ``h q^(r)`` that this coordinate is to have.
        restraint: By what all of this is held back; None for nothing.
    """

    desired: ca.SX
    scale: ca.SX | None = None
    slope: ca.SX | None = None
    rate: ca.SX | float = 0.0
    restraint: Restraint | None = None


class DecouplingSolution(NamedTuple):
    """Solution of ``A x = rhs`` and how far A is from singular.

    Attributes:
        x: Highest joint derivative, shape (N,); NaN where A is singular.
        rcond: Reciprocal condition number of A in [0, 1], 0 if A is singular or not finite: in the
            1-norm; where A has more columns than rows, or damping may set in, ``m / (|A| |A^+|)``
            (Frobenius), which changes as smoothly as A does.
        usable: Whether the solution may be used, 1 or 0.
        residual: ``rhs - A x``, shape (m,), that damping near a singular A leaves, else zeros.
        rest: The same as x without what joints are to do beside the outputs, as far as they are
            held back, shape (N,); None where they are not.
    """

    x: ca.SX
    rcond: ca.SX
    usable: ca.SX
    residual: ca.SX
    rest: ca.SX | None = None


@dataclass(frozen=True)
class DecouplingInverse(Parameters):
    """Solves ``A q^(r) = v - b`` and judges the conditioning of A, shape (m, N) with N >= m.

    With as many joints as outputs that is one linear system. With more, it is the solution
    that deviates least from a desired value w, weighted by W::

        x = w + W^-1 A' (A W^-1 A')^-1 (rhs - A w)

    and then, within what leaves the outputs alone, the one that gives one more coordinate of the
    joints the rate that is wanted of it. It fades out where it hardly moves without the outputs.

    Restraint: with ``x_0`` the solution by which joints come to rest as far as the outputs let
    them, everything else ends in joint velocities ``u = (x - x_0) / a_2`` beside those ``q_y'``
    that the outputs take. What is used is ``x_0 + s (x - x_0)`` with the largest ``s <= 1`` for
    which ``|q_y'| + s |u|`` stays below every joint's largest speed, and ``q_y' + s u`` below that
    with which a joint comes to rest before its end, unless the outputs alone take more. So a
    posture far away, or a coordinate that hardly moves alone, asks for no more than joints can do.

    Damping: where the reciprocal condition number c is below ``damped_below = c_0``, the system
    is solved with ``A W^-1 A' + lambda^2 I``, ``lambda^2 = (c_0^2 - c^2) |A S|^2`` (Frobenius),
    which keeps x bounded through a singular posture; what the outputs miss is told.

    Attributes:
        min_rcond: Smallest reciprocal condition number (rows in m and rad) at which the solution
            may be used, unless it is damped.
        damped_below: Reciprocal condition number below which the solution is damped; 0 for never.
    """

    min_rcond: Annotated[float, Range(0.0, 1.0, open=True, below=True)] = 1e-3
    damped_below: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.damped_below != 0.0 and not self.min_rcond < self.damped_below < 1.0:
            raise InputError(
                f"damped_below: {self.damped_below}; must be 0, or lie between min_rcond = "
                f"{self.min_rcond:g} and 1"
            )

    def solve(self, A: ca.SX, rhs: ca.SX, spare: Spare | None = None) -> DecouplingSolution:
        """Return the solution of the linear system as expressions.

        Args:
            A: Decoupling matrix, shape (m, N).
            rhs: Right-hand side, shape (m,).
            spare: What joints beyond the number of outputs are to do; needed if N > m.
        """
        if spare is not None or self.damped_below:
            return self._solve_next_to(A, rhs, spare or Spare(ca.SX(A.shape[1], 1)))
        x, rcond = solve(A, rhs)
        return DecouplingSolution(x, rcond, rcond >= self.min_rcond, ca.SX(*rhs.shape))

    def _solve_next_to(self, A: ca.SX, rhs: ca.SX, spare: Spare) -> DecouplingSolution:
        """Solve a system with a desired solution, or with damping."""
        B = A if spare.scale is None else A @ spare.scale
        sides = _sides(A, rhs, spare)
        Q, R = householder(B.T)
        # conditioning is that of the outputs, whatever the weight
        rcond = _rcond(A, R if spare.scale is None else householder(A.T)[1])
        y, damped = Q @ solve_upper(R, sides, transposed=True), ca.SX(0)
        missed = ca.SX(*sides.shape)
        if self.damped_below:
            damped = ca.logic_and(rcond < self.damped_below, all_finite(B, rhs))
            square = ca.fmax(self.damped_below**2 - rcond**2, 0.0) * ca.sumsqr(B)
            U = cholesky(B @ B.T + square * ca.SX.eye(B.shape[0]))
            z = solve_upper(U, solve_upper(U, sides, transposed=True))
            y, missed = where(damped, B.T @ z, y), where(damped, square * z, 0.0)
        x, rest, share = _restrained(Q, y, spare)
        x = where(ca.logic_or(rcond > 0.0, damped), x, np.nan)
        residual = missed[:, 0]
        if rest is not None:
            residual = share * residual + (1.0 - share) * missed[:, 1]
        usable = ca.logic_or(rcond >= self.min_rcond, damped)
        return DecouplingSolution(x, rcond, usable, residual, rest)


def scale_of(weight: ca.SX) -> ca.SX:
    """Return the upper triangular ``S`` with ``S S' = W^-1``, shape (N, N).

    Args:
        weight: ``W``, symmetric, shape (N, N); if it is not positive definite, S is of NaN.
    """
    return solve_upper(cholesky(weight), ca.SX.eye(weight.shape[0]))


def free_torque(A: ca.SX, torque: ca.SX, scale: ca.SX | None = None) -> ca.SX:
    """Return the part of joint torques that does no work on the outputs, shape (N,).

    That is ``N' tau`` with ``N = I - W^-1 A' (A W^-1 A')^-1 A``.

    Args:
        A: Decoupling matrix, shape (m, N) with N > m.
        torque: ``tau``, shape (N,).
        scale: Upper triangular ``S`` with ``S S' = W^-1``, shape (N, N); None for the identity.
    """
    if scale is None:
        return _beside(householder(A.T)[0], torque)
    free = _beside(householder((A @ scale).T)[0], scale.T @ torque)
    return solve_upper(scale, free, transposed=True)


def _beside(Q: ca.SX, x: ca.SX) -> ca.SX:
    """Return what is left of a vector beside the span of orthonormal columns."""
    return x - Q @ (Q.T @ x)


def _rcond(B: ca.SX, R: ca.SX) -> ca.SX:
    """Return ``m / (|B| |R^-1|)``, Frobenius, of ``B' = Q R``; 0 if B is singular or not finite."""
    m = B.shape[0]
    square = ca.sumsqr(B) * ca.sumsqr(solve_upper(R, ca.SX.eye(m)))
    regular = ca.logic_and(square > 0.0, all_finite(square))
    return where(regular, m / ca.sqrt(where(regular, square, 1.0)), 0.0)


def _next_to(Q: ca.SX, y: ca.SX, spare: Spare) -> ca.SX:
    """Return ``desired + S y``, with the rate of the spare coordinate where it can move alone.

    Args:
        Q: Orthonormal columns that span the rows of ``A S``, shape (N, m).
        y: What the outputs ask for beyond the desired value, shape (N,).
        spare: What is desired of the spare motion.
    """
    scale = ca.SX.eye(Q.shape[0]) if spare.scale is None else spare.scale
    x = spare.desired + scale @ y
    if spare.slope is None:
        return x
    whole = scale.T @ spare.slope
    alone = _beside(Q, whole)
    # continuous: a coordinate that can hardly move alone is given up
    divisor = ca.fmax(ca.sumsqr(alone), _LEAST_SHARE**2 * ca.sumsqr(whole))
    missing = (spare.rate - ca.dot(spare.slope, x)) / where(divisor > 0.0, divisor, 1.0)
    return x + scale @ (alone * missing)


def _sides(A: ca.SX, rhs: ca.SX, spare: Spare) -> ca.SX:
    """Return what is left to the outputs beside desired motion, rest and nothing, as columns."""
    sides, restraint = [rhs - A @ spare.desired], spare.restraint
    if restraint is not None:
        sides.append(rhs - A @ restraint.rest)
        if restraint.velocity is not None:
            sides.append(A @ restraint.velocity)
    return ca.horzcat(*sides)


def _restrained(Q: ca.SX, y: ca.SX, spare: Spare) -> tuple[ca.SX, ca.SX | None, ca.SX]:
    """Return the solution, the one of joints that come to rest, and the share beyond that.

    Args:
        Q: Orthonormal columns that span the rows of ``A S``, shape (N, m).
        y: Value of each side of :func:`_sides`, as columns.
        spare: What joints are to do.
    """
    x, restraint = _next_to(Q, y[:, 0], spare), spare.restraint
    if restraint is None:
        return x, None, ca.SX(1)
    others = y[:, 1:] if spare.scale is None else spare.scale @ y[:, 1:]
    rest = restraint.rest + others[:, 0]
    taken = rest if restraint.velocity is None else others[:, 1]
    beyond = ca.fabs(x - rest) / restraint.settling
    left = restraint.speeds - ca.fabs(taken)
    if restraint.to_ends is not None:
        up, down = ca.horzsplit(restraint.to_ends)
        left = ca.fmin(left, where(x > rest, up - taken, down + taken))
    left = ca.fmax(left, 0.0)
    fast = beyond > left
    share = ca.mmin(where(fast, left / where(fast, beyond, 1.0), 1.0))
    return where(share < 1.0, rest + share * (x - rest), x), rest, share
