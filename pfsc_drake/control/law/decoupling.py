"""Inversion of the decoupling matrix, with spare motion, restraint and damping."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import casadi as ca
import numpy as np

from pfsc_drake.blocks.cases import all_finite, where
from pfsc_drake.blocks.linear_algebra import cholesky, householder, solve, solve_upper
from pfsc_drake.errors import InputError
from pfsc_drake.yaml.rules import Parameters, Range

# of a posture's coordinate, least share of its motion with the outputs at rest
_LEAST_SHARE = 0.1


class Restraint(NamedTuple):
    """Limits of joint speeds by motion beside the outputs.

    Attributes:
        rest: Highest joint derivative with which they come to rest, shape (N,).
        velocity: Velocity of the joints, shape (N,); None if the highest derivative is a velocity.
        settling: ``a_2``: joints finally move with ``(x - rest) / a_2``.
        speeds: Largest speeds of the joints, shape (N,), infinite for any.
        to_ends: Largest speeds upwards and downwards at which they come to rest before their ends,
            shape (N, 2); None for any.
    """

    rest: ca.SX
    velocity: ca.SX | None
    settling: float
    speeds: np.ndarray
    to_ends: ca.SX | None = None


class Spare(NamedTuple):
    """Spare motion of redundant joints.

    Attributes:
        desired: Desired highest joint derivative, shape (N,).
        scale: Upper triangular ``S`` with ``S S' = W^-1``, shape (N, N), of the weight W of
            deviations from it, see :func:`scale_of`; None for the identity.
        slope: Slope of one more coordinate ``c`` of the joints, ``h = dc/dq``, shape (N,); None for
            none.
        rate: Desired ``h q^(r)`` of this coordinate.
        restraint: Limits of this motion; None for none.
    """

    desired: ca.SX
    scale: ca.SX | None = None
    slope: ca.SX | None = None
    rate: ca.SX | float = 0.0
    restraint: Restraint | None = None


class DecouplingSolution(NamedTuple):
    """Solution of ``A x = rhs`` and conditioning of A.

    Attributes:
        x: Highest joint derivative, shape (N,); NaN where A is singular.
        rcond: Reciprocal condition number of A in [0, 1], 0 if A is singular or not finite: in the
            1-norm; if A has more columns than rows, or with damping, ``m / (|A| |A^+|)``
            (Frobenius), which is as smooth as A.
        usable: Whether the solution may be used, 1 or 0.
        residual: ``rhs - A x``, shape (m,), due to damping near a singular A, else zeros.
        rest: The same as x without spare motion, shape (N,); None without a restraint.
    """

    x: ca.SX
    rcond: ca.SX
    usable: ca.SX
    residual: ca.SX
    rest: ca.SX | None = None


@dataclass(frozen=True)
class DecouplingInverse(Parameters):
    """Solver of ``A q^(r) = v - b`` with a check of the conditioning of A, (m, N) with N >= m.

    With as many joints as outputs it is one linear system. With more joints, it is the solution
    with the least weighted deviation from a desired value w::

        x = w + W^-1 A' (A W^-1 A')^-1 (rhs - A w)

    and then, in the null space of the outputs, the one with the desired rate of one more
    coordinate of the joints. This rate fades out where the coordinate depends on the outputs.

    Restraint: with ``x_0`` the solution for joints that come to rest as far as the outputs permit,
    the remaining motion leads to joint velocities ``u = (x - x_0) / a_2`` beside ``q_y'`` of the
    outputs. The result is ``x_0 + s (x - x_0)`` with the largest ``s <= 1`` for which
    ``|q_y'| + s |u|`` is below every joint's largest speed, and ``q_y' + s u`` below the speed at
    which a joint comes to rest before its end, unless the outputs alone need more. So a distant
    posture, or a coordinate that depends on the outputs, does not demand too much of the joints.

    Damping: where the reciprocal condition number c is below ``damped_below = c_0``, the system
    is solved with ``A W^-1 A' + lambda^2 I``, ``lambda^2 = (c_0^2 - c^2) |A S|^2`` (Frobenius),
    which keeps x bounded through a singular posture; the error of the outputs is ``residual``.

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
            spare: Spare motion of redundant joints; needed if N > m.
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
        # the conditioning of the outputs does not depend on the weight
        rcond = _rcond(A, R if spare.scale is None else householder(A.T)[1])
        y, damped = Q @ solve_upper(R, sides, transposed=True), ca.SX(0)
        missed = ca.SX(*sides.shape)
        if self.damped_below:
            damped = ca.logic_and(rcond < self.damped_below, all_finite(B, rhs))
            square = ca.fmax(self.damped_below**2 - rcond**2, 0.0) * ca.sumsqr(B)
            U = cholesky(B @ B.T + square * ca.SX.eye(B.shape[0]))
            z = solve_upper(U, solve_upper(U, sides, transposed=True))
            y, missed = where(damped, B.T @ z, y), where(damped, square * z, 0.0)
        x, rest, share = _apply_restraint(Q, y, spare)
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
        return _complement(householder(A.T)[0], torque)
    free = _complement(householder((A @ scale).T)[0], scale.T @ torque)
    return solve_upper(scale, free, transposed=True)


def _complement(Q: ca.SX, x: ca.SX) -> ca.SX:
    """Return a vector minus its projection onto the span of orthonormal columns."""
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
        y: Deviation from the desired value for the outputs, shape (N,).
        spare: Spare motion.
    """
    scale = ca.SX.eye(Q.shape[0]) if spare.scale is None else spare.scale
    x = spare.desired + scale @ y
    if spare.slope is None:
        return x
    whole = scale.T @ spare.slope
    alone = _complement(Q, whole)
    # continuous: the rate of a coordinate that depends on the outputs fades out
    divisor = ca.fmax(ca.sumsqr(alone), _LEAST_SHARE**2 * ca.sumsqr(whole))
    missing = (spare.rate - ca.dot(spare.slope, x)) / where(divisor > 0.0, divisor, 1.0)
    return x + scale @ (alone * missing)


def _sides(A: ca.SX, rhs: ca.SX, spare: Spare) -> ca.SX:
    """Return right-hand sides of the outputs beside desired motion, rest and none, as columns."""
    sides, restraint = [rhs - A @ spare.desired], spare.restraint
    if restraint is not None:
        sides.append(rhs - A @ restraint.rest)
        if restraint.velocity is not None:
            sides.append(A @ restraint.velocity)
    return ca.horzcat(*sides)


def _apply_restraint(Q: ca.SX, y: ca.SX, spare: Spare) -> tuple[ca.SX, ca.SX | None, ca.SX]:
    """Return the solution, the one of joints that come to rest, and the share beyond that.

    Args:
        Q: Orthonormal columns that span the rows of ``A S``, shape (N, m).
        y: Value of each side of :func:`_sides`, as columns.
        spare: Spare motion.
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
