"""Linear algebra of small dense matrices as expressions, without loops that depend on values.

All functions take and return expressions of scalars (``casadi.SX``). Nothing is raised: a result
that does not exist is NaN, or has a reciprocal condition number of 0.
"""

import itertools

import casadi as ca
import numpy as np

from pfsc_drake.blocks.cases import all_finite, all_of, where

_SWEEPS = 6


def solve(A: ca.SX, B: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return ``A^-1 B`` and the reciprocal condition number of A.

    By elimination with partial pivots. The reciprocal condition number is
    ``1 / (|A|_1 |A^-1|_1)``, exactly, not LAPACK's estimate, which is somewhat larger.

    Args:
        A: Square matrix, shape (n, n).
        B: Right-hand sides as columns, shape (n, k).

    Returns:
        ``A^-1 B``, shape (n, k), of NaN where A is singular or not finite; and a number in [0, 1],
        0 there.
    """
    n = A.shape[0]
    rows = ca.vertsplit(ca.densify(ca.horzcat(A, B)))
    for k in range(n):
        for i in range(k + 1, n):
            larger = ca.fabs(rows[i][k]) > ca.fabs(rows[k][k])
            rows[k], rows[i] = where(larger, rows[i], rows[k]), where(larger, rows[k], rows[i])
        for i in range(k + 1, n):
            factor = rows[i][k] / rows[k][k]
            rows[i] = ca.horzcat(rows[i][:k], factor, rows[i][k + 1 :] - factor * rows[k][k + 1 :])
    U, X = upper_part(ca.vertcat(*[row[:n] for row in rows])), ca.vertcat(*[r[n:] for r in rows])
    L = upper_part(ca.vertcat(*[row[:n] for row in rows]).T, unit=True).T
    # the order of rows, which pivots change, only orders the columns of the inverse
    inverse = solve_upper(U, solve_upper(L.T, ca.SX.eye(n), transposed=True))
    regular = all_finite(A, inverse)
    rcond = where(regular, 1.0 / (norm_1(A) * norm_1(inverse)), 0.0)
    return where(regular, solve_upper(U, X), np.nan), rcond


def householder(M: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return ``Q, R`` of ``M = Q R``, with orthonormal columns in Q and R upper triangular.

    Args:
        M: Matrix of at least as many rows as columns, shape (n, m). Where it has no full rank,
            there is a zero on R's diagonal, up to rounding.

    Returns:
        Shapes (n, m) and (m, m).
    """
    n, m = M.shape
    R, reflections = ca.densify(M), []
    for k in range(min(m, n - 1)):
        x = R[k:, k]
        norm = ca.sqrt(ca.sumsqr(x))
        pivot = -ca.copysign(norm, x[0])
        v = ca.SX(x)
        v[0] -= pivot
        # |v|^2 / 2, zero if nothing is to be reflected
        square = norm * (norm + ca.fabs(x[0]))
        w = where(square > 0.0, v / square, 0.0)
        R[k:, k:] -= v @ (w.T @ R[k:, k:])
        R[k, k] = pivot
        reflections.append((v, w))
    Q = ca.densify(ca.SX.eye(n)[:, :m])
    for k, (v, w) in reversed(list(enumerate(reflections))):
        Q[k:, k:] -= v @ (w.T @ Q[k:, k:])
    return Q, upper_part(R[:m, :])


def cholesky(M: ca.SX) -> ca.SX:
    """Return the upper triangular U of ``M = U' U``.

    Args:
        M: Symmetric positive definite, shape (n, n); if it is not, U is of NaN.
    """
    n = M.shape[0]
    U, positive = ca.SX(n, n), []
    for k in range(n):
        square = M[k, k] - ca.sumsqr(U[:k, k])
        positive.append(square > 0.0)
        U[k, k] = ca.sqrt(square)
        for j in range(k + 1, n):
            U[k, j] = (M[k, j] - ca.dot(U[:k, k], U[:k, j])) / U[k, k]
    return upper_part(where(all_of(*positive), ca.densify(U), np.nan))


def symmetric_eigen(A: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return eigenvalues and eigenvectors of a symmetric matrix.

    By Jacobi's rotations, each of which makes one element zero, in a fixed number of sweeps over
    all of them. They converge quadratically; six are enough for matrices of up to ten rows.

    Args:
        A: Symmetric, shape (n, n).

    Returns:
        Eigenvalues, shape (n,), in no order, and the vectors as columns, shape (n, n).
    """
    n = A.shape[0]
    A, V = ca.densify(A), ca.densify(ca.SX.eye(n))
    for p, q in _SWEEPS * list(itertools.combinations(range(n), 2)):
        x, gap = A[p, q], A[q, q] - A[p, p]
        longer = gap + ca.copysign(ca.sqrt(gap**2 + 4.0 * x**2), gap)
        # also values so small that their square is zero
        t = where(longer == 0.0, 0.0, 2.0 * x / longer)
        c = 1.0 / ca.sqrt(1.0 + t**2)
        for i in set(range(n)) - {p, q}:
            turned = c * (A[i, p] - t * A[i, q]), c * (A[i, q] + t * A[i, p])
            A[i, p], A[i, q] = A[p, i], A[q, i] = turned
        A[p, p], A[q, q], A[p, q], A[q, p] = A[p, p] - t * x, A[q, q] + t * x, 0.0, 0.0
        V[:, p], V[:, q] = c * (V[:, p] - t * V[:, q]), c * (V[:, q] + t * V[:, p])
    return ca.diag(A), V


def solve_upper(U: ca.SX, B: ca.SX, *, transposed: bool = False) -> ca.SX:
    """Return ``U^-1 B`` or ``U'^-1 B`` of an upper triangular U by substitution.

    Args:
        U: Shape (n, n); entries below its diagonal are ignored.
        B: Right-hand sides as columns, shape (n, k).
        transposed: Whether to use U'.
    """
    n, T = U.shape[0], U.T if transposed else U
    rows: list[ca.SX] = ca.vertsplit(B)
    order = list(range(n)) if transposed else list(reversed(range(n)))
    for i, k in enumerate(order):
        for j in order[:i]:
            rows[k] = rows[k] - T[k, j] * rows[j]
        rows[k] = rows[k] / T[k, k]
    return ca.vertcat(*rows)


def upper_part(M: ca.SX, *, unit: bool = False) -> ca.SX:
    """Return the upper triangle of a square matrix with its diagonal.

    Args:
        M: Shape (n, n).
        unit: Whether the diagonal is replaced by ones.
    """
    if not unit:
        return ca.triu(M)
    return ca.triu(M, False) + ca.SX.eye(M.shape[0])


def norm_1(M: ca.SX) -> ca.SX:
    """Return the largest column sum of magnitudes, shape (1, 1).

    Args:
        M: Finite entries, shape (n, m); NaN entries are not detected.
    """
    return ca.mmax(ca.densify(ca.sum1(ca.fabs(M))))
