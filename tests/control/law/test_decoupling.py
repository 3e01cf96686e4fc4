"""The one place that inverts a decoupling matrix."""

import numpy as np
import pytest

from pfsc_drake.control.law.decoupling import DecouplingInverse, DecouplingSolution
from pfsc_drake.errors import InputError


def test_solution_and_condition_match_numpy():
    rng = np.random.default_rng(1)
    inverse = DecouplingInverse()
    for n in (3, 6):
        for _ in range(20):
            A, rhs = rng.normal(size=(n, n)), rng.normal(size=n)
            solution = inverse.solve(A, rhs)
            condition = np.linalg.cond(A, 1)
            assert np.allclose(solution.x, np.linalg.solve(A, rhs), rtol=1e-11 * condition)
            # an estimate from below of the norm of the inverse, rarely off by more than three
            assert 1.0 - 1e-9 < solution.rcond * condition < 10.0


def test_neither_argument_is_changed():
    A, rhs = np.asfortranarray(np.diag([2.0, 4.0, 8.0])), np.ones(3)
    A[0, 2] = 1.0
    before = A.copy()
    DecouplingInverse().solve(A, rhs)
    assert np.array_equal(A, before)
    assert np.array_equal(rhs, np.ones(3))


def test_the_matrix_is_not_transposed():
    A = np.array([[1.0, 2.0], [0.0, 1.0]])
    for ordered in (np.ascontiguousarray(A), np.asfortranarray(A)):
        assert np.allclose(DecouplingInverse().solve(ordered, np.array([5.0, 2.0])).x, [1.0, 2.0])


@pytest.mark.parametrize("A", [np.zeros((3, 3)), np.diag([1.0, 0.0, 1.0])])
def test_a_singular_matrix_is_not_accepted(A):
    inverse = DecouplingInverse(1e-12)
    solution = inverse.solve(A, np.ones(3))
    assert np.all(np.isnan(solution.x))
    assert solution.rcond == 0.0
    assert not inverse.accepts(solution)


def test_a_nearly_singular_matrix_is_not_accepted():
    inverse = DecouplingInverse(1e-12)
    A = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]])
    assert not inverse.accepts(inverse.solve(A, np.ones(3)))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_matrix_that_is_not_finite_is_not_accepted(bad):
    A = np.eye(3)
    A[1, 2] = bad
    inverse = DecouplingInverse()
    assert not inverse.accepts(inverse.solve(A, np.ones(3)))


def test_the_limit_of_the_condition_number():
    # A diagonal matrix's reciprocal condition number is the ratio of its extremes
    A, rhs = np.diag([1.0, 0.5, 0.01]), np.ones(3)
    assert DecouplingInverse(0.009).accepts(DecouplingInverse(0.009).solve(A, rhs))
    assert not DecouplingInverse(0.011).accepts(DecouplingInverse(0.011).solve(A, rhs))
    assert not DecouplingInverse(0.5).accepts(DecouplingSolution(rhs, np.nan))


@pytest.mark.parametrize("min_rcond", [0.0, 1.0, -1.0, np.nan])
def test_the_limit_must_lie_between_zero_and_one(min_rcond):
    with pytest.raises(InputError, match="min_rcond"):
        DecouplingInverse(min_rcond)
