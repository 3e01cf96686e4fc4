"""Linear algebra as expressions, against LAPACK and scipy."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
import scipy.linalg

from pfsc_drake.blocks import linear_algebra

NAN, INF = np.nan, np.inf


@cache
def compiled(name, *shapes, **options):
    symbols = [ca.SX.sym(f"x{i}", *shape) for i, shape in enumerate(shapes)]
    results = getattr(linear_algebra, name)(*symbols, **options)
    results = results if isinstance(results, tuple) else (results,)
    return ca.Function(name, symbols, [ca.densify(result) for result in results])


def on_numbers(name, *arrays, **options):
    values = compiled(name, *[np.shape(x) for x in arrays], **options)(*arrays)
    return np.array(values) if isinstance(values, ca.DM) else [np.array(x) for x in values]


def conditioned(seed, n, condition):
    """Return a matrix of a condition number in the 2-norm."""
    rng = np.random.default_rng(seed)
    U, V = (np.linalg.qr(rng.normal(size=(n, n)))[0] for _ in range(2))
    return U @ np.diag(np.geomspace(1.0, 1.0 / condition, n)) @ V


@pytest.mark.parametrize("n", [1, 2, 3, 6, 7])
def test_solution_and_condition_number(n):
    rng = np.random.default_rng(n)
    for _ in range(20):
        A, B = rng.normal(size=(n, n)), rng.normal(size=(n, 2))
        X, rcond = on_numbers("solve", A, B)
        assert rcond.item() == pytest.approx(1.0 / np.linalg.cond(A, 1), rel=1e-9)
        np.testing.assert_allclose(X, np.linalg.solve(A, B), rtol=1e-11 / rcond.item())


@pytest.mark.parametrize("condition", [1e3, 1e8, 1e12])
def test_ill_conditioned_matrices_are_solved_as_lapack_does(condition):
    for seed in range(10):
        A = conditioned(seed, 6, condition)
        B = A @ np.ones((6, 1))
        X, rcond = on_numbers("solve", A, B)
        # backward stable: the residual is small whatever the condition
        assert np.abs(A @ X - B).max() < 1e-14 * np.abs(X).max()
        assert rcond.item() == pytest.approx(1.0 / np.linalg.cond(A, 1), rel=1e-15 * condition**1.3)
        lu, _, _ = scipy.linalg.lapack.dgetrf(A)
        estimate, _ = scipy.linalg.lapack.dgecon(lu, np.linalg.norm(A, 1))
        assert 0.3 < rcond.item() / estimate < 1.0 + 1e-15 * condition**1.3


def test_pivots_are_chosen():
    A = np.array([[1e-20, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 3.0, 1.0]])
    X, _ = on_numbers("solve", A, np.array([[1.0], [2.0], [0.0]]))
    np.testing.assert_allclose(X.ravel(), [1.0, 1.0, -3.0], rtol=1e-15)
    for order in ((1, 2, 0), (2, 0, 1), (2, 1, 0)):
        permutation = np.eye(3)[list(order)]
        X, rcond = on_numbers("solve", permutation, np.arange(3.0)[:, None])
        np.testing.assert_array_equal(X, permutation.T @ np.arange(3.0)[:, None])
        assert rcond.item() == 1.0


@pytest.mark.parametrize(
    "A",
    [
        np.zeros((3, 3)),
        np.diag([1.0, 0.0, 1.0]),
        np.ones((3, 3)),
        np.array([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 1.0]]),
    ],
)
def test_a_singular_matrix_has_no_solution(A):
    X, rcond = on_numbers("solve", A, np.ones((3, 1)))
    assert rcond.item() == 0.0
    assert np.isnan(X).all()


@pytest.mark.parametrize("bad", [NAN, INF, -INF])
def test_a_matrix_that_is_not_finite_has_no_solution(bad):
    for index in np.ndindex(3, 3):
        A = np.eye(3) + 0.1
        A[index] = bad
        X, rcond = on_numbers("solve", A, np.ones((3, 1)))
        assert rcond.item() == 0.0
        assert np.isnan(X).all()


@pytest.mark.parametrize("shape", [(3, 3), (7, 6), (6, 3), (4, 1)])
def test_orthonormal_columns_times_an_upper_triangle(shape):
    for seed in range(10):
        M = np.random.default_rng(seed).normal(size=shape)
        Q, R = on_numbers("householder", M)
        np.testing.assert_allclose(Q @ R, M, atol=1e-14)
        np.testing.assert_allclose(Q.T @ Q, np.eye(shape[1]), atol=1e-14)
        np.testing.assert_array_equal(np.tril(R, -1), 0.0)
        expected_Q, expected_R = np.linalg.qr(M)
        np.testing.assert_allclose(Q, expected_Q, atol=1e-13)
        np.testing.assert_allclose(R, expected_R, atol=1e-13)


@pytest.mark.parametrize("M", [np.zeros((3, 2)), np.ones((3, 2)), np.eye(3)[:, :2], -np.eye(3)])
def test_columns_that_lack_rank(M):
    Q, R = on_numbers("householder", M)
    np.testing.assert_allclose(Q @ R, M, atol=1e-15)
    np.testing.assert_allclose(np.abs(np.diag(R)), np.abs(np.diag(np.linalg.qr(M)[1])), atol=1e-15)
    np.testing.assert_allclose(Q.T @ Q, np.eye(M.shape[1]), atol=1e-15)


@pytest.mark.parametrize("n", [1, 3, 7])
def test_the_root_of_a_positive_definite_matrix(n):
    M = conditioned(1, n, 1e3)
    M = M @ M.T
    np.testing.assert_allclose(on_numbers("cholesky", M), np.linalg.cholesky(M).T, atol=1e-12)
    assert np.isnan(np.diag(on_numbers("cholesky", -M))).all()
    M[-1, -1] = NAN
    assert np.isnan(np.diag(on_numbers("cholesky", M))).all()


@pytest.mark.parametrize("transposed", [False, True])
def test_substitution(transposed):
    rng = np.random.default_rng(4)
    # what is below the diagonal does not count
    U, B = rng.normal(size=(6, 6)), rng.normal(size=(6, 3))
    expected = scipy.linalg.solve_triangular(U, B, trans=int(transposed))
    found = on_numbers("solve_upper", U, B, transposed=transposed)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize("tiny", [1e-170, 5e-324])
def test_eigenvalues_where_the_squares_beside_the_diagonal_are_zero(tiny):
    found, V = on_numbers("symmetric_eigen", np.eye(3) + tiny * (1.0 - np.eye(3)))
    np.testing.assert_array_equal(found.ravel(), np.ones(3))
    np.testing.assert_allclose(V.T @ V, np.eye(3), atol=1e-15)


@pytest.mark.parametrize("n", [1, 2, 3, 6, 7])
def test_eigenvalues_and_vectors(n):
    """Also where they are all the same, nearly the same, or some are zero."""
    rng = np.random.default_rng(n)
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    some = [rng.normal(size=n), np.ones(n), 1.0 + 1e-9 * np.arange(n), np.arange(n) // 2 * 1.0]
    for values in (*some, np.geomspace(1.0, 1e-8, n)):
        A = Q @ np.diag(values) @ Q.T
        A = (A + A.T) / 2.0
        found, V = on_numbers("symmetric_eigen", A)
        np.testing.assert_allclose(np.sort(found.ravel()), np.linalg.eigvalsh(A), atol=1e-14)
        np.testing.assert_allclose(V.T @ V, np.eye(n), atol=1e-13)
        np.testing.assert_allclose(A @ V, V @ np.diag(found.ravel()), atol=1e-13)
