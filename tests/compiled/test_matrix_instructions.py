"""Instructions of functions of matrices, each against the interpreter."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.compiled.native_code import why_not
from tests.compiled.interpreter import SPECIAL, assert_agrees, assert_same_bits, both, compiled

X, Z, Y = ca.MX.sym("x", 4), ca.MX.sym("z", 4), ca.MX.sym("y")
A, B = ca.MX.sym("A", 3, 4), ca.MX.sym("B", 4, 2)
LOWER = ca.MX.sym("L", ca.Sparsity.lower(3))
HOLES = ca.MX.sym("H", ca.Sparsity.triplet(4, 3, [0, 3, 1, 3], [0, 0, 2, 2]))
SYMBOLS = [X, Z, Y, A, B, LOWER, HOLES]
TABLE = ca.DM(np.random.default_rng(0).normal(size=(4, 4)))
UNARY = [
    "sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh exp log log1p expm1 sqrt fabs",
    "sign floor ceil erf logic_not sumsqr",
]
BINARY = ["fmin fmax fmod remainder copysign atan2 hypot logic_and logic_or power"]


def set_block():
    M = ca.MX(A)
    M[:2, ::2] = 2.0 * B[:2, :]
    return M


def set_sparse_block():
    M = ca.MX(HOLES)
    M[3, 2] = Y
    M[1, 2] += X[0]
    return M


def set_slice():
    x = ca.MX(X)
    x[::2] = Z[1:3]
    return x


def jacobian(expression):
    """Return what differentiation makes of an expression: other instructions than people write."""
    return ca.jacobian(expression, X)


EXPRESSIONS = {
    **{name: getattr(ca, name)(X) for line in UNARY for name in line.split()},
    **{name: getattr(ca, name)(X, Z) for line in BINARY for name in line.split()},
    "add": X + Z,
    "subtract": X - Z,
    "multiply": X * Z,
    "divide": X / Z,
    "negate": -X,
    "square": X * X,
    "twice": X + X,
    "inverse of numbers": 1.0 / X,
    "constant power": X**1.7,
    "compare": ca.vertcat(X < Z, X <= Z, X == Z, X != Z, ca.logic_not(X < Z)),
    "scalar and matrix": Y * A - A / Y + (Y < A),
    "matrix and scalar": ca.fmax(A, Y) + A**Y,
    "cases": ca.if_else(Y > 0.0, X, Z),
    "cases by elements": ca.if_else(X, Z, 1.0),
    "condition as number": 2.0 * (X < Z) + ca.logic_and(X, Z > 0.0),
    "zero, constants, NaN": ca.vertcat(X, 0.0, -0.0, 1.5, np.nan, np.inf),
    "dense constant": ca.MX(TABLE) @ X,
    "sparse constant": ca.MX(ca.sparsify(ca.DM([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]))) @ A,
    "element": X[2],
    "slice": X[1:],
    "slice with a step": X[::-2],
    "columns of a matrix": A[:, 1:3],
    "block of a matrix": A[1:, ::3],
    "picked": X[[3, 0, 0]],
    "picked of a sparse matrix": HOLES[[0, 3], :],
    "set": set_block(),
    "set in a sparse matrix": set_sparse_block(),
    "set with a step": set_slice(),
    "vertcat": ca.vertcat(X, Y, Z),
    "vertcat of matrices": ca.vertcat(A, B.T),
    "horzcat": ca.horzcat(X, B),
    "horzcat of sparse": ca.horzcat(LOWER, A),
    "diagcat": ca.diagcat(A, Y, LOWER),
    "vertsplit": ca.vertsplit(X, [0, 1, 4])[1],
    "horzsplit": ca.horzsplit(A, [0, 2, 4])[1] * 2.0,
    "horzsplit of sparse": ca.horzsplit(LOWER, [0, 1, 3])[1],
    "diagsplit": ca.diagsplit(ca.diagcat(A, B), [0, 3, 7], [0, 4, 6])[1],
    "reshape": ca.reshape(A, 6, 2),
    "reshape of sparse": ca.reshape(LOWER, 9, 1),
    "transpose": A.T,
    "transpose of sparse": HOLES.T,
    "densify": ca.densify(HOLES),
    "project": ca.project(A[:, :3], ca.Sparsity.lower(3)),
    "project sparse": ca.project(LOWER, ca.Sparsity.upper(3)),
    "product": A @ B,
    "product with a vector": A @ X,
    "product of sparse": HOLES @ LOWER,
    "product of dense and sparse": A @ HOLES,
    "product of sparse and dense": HOLES @ A,
    "product of structurally compact": HOLES[:, :1] @ A[:1, :],
    "product and sum": ca.mac(A, B, ca.MX.ones(3, 2)),
    "product into a pattern": ca.mac(
        A, B, ca.project(ca.MX.ones(3, 2), ca.Sparsity.triplet(3, 2, [0, 2], [0, 1]))
    ),
    "inner product": ca.dot(X, Z),
    "inner product of matrices": ca.dot(A, 2.0 * A),
    "bilinear": ca.bilin(A, Z[:3], X),
    "rank one": ca.rank1(A, Y, Z[:3], X),
    "norm 2": ca.norm_2(X),
    "norm 1": ca.norm_1(X),
    "norm inf": ca.norm_inf(X),
    "norm of a matrix": ca.norm_fro(A),
    "norm of sparse": ca.norm_inf(HOLES),
    "sums": ca.vertcat(ca.sum1(A).T, ca.sum2(A)),
    "largest": ca.mmax(A),
    "smallest": ca.mmin(A),
    "largest of sparse": ca.mmax(HOLES),
    "smallest of sparse": ca.mmin(HOLES),
    "find": ca.find(ca.floor(X)),
    "find in sparse": ca.find(ca.floor(HOLES[:, 2])),
    "repeated": ca.repmat(X, 2, 3),
    "repeated sum": ca.jacobian(ca.repmat(X, 1, 3).T, X) @ X,
    "kron": ca.kron(X[:2], A),
    "kron of sparse": ca.kron(LOWER, HOLES),
    "cumulated": ca.cumsum(X),
    "differences": ca.diff(X),
    "cross product": ca.cross(X[:3], Z[:3]),
    "skew": ca.skew(X[:3]),
    "polynomial": ca.polyval(X, Y),
    "derivative": jacobian(ca.sin(X) * ca.norm_2(X)),
    "derivative of a product": jacobian(A @ X * Y),
    "derivative of cases": jacobian(ca.if_else(X[0] > 0.0, X * Z, ca.fmin(X, Z))),
    "derivative of the largest": jacobian(ca.mmax(X)),
    "gradient": ca.gradient(ca.sumsqr(A @ ca.sin(X)), X),
    "second derivative": ca.hessian(ca.sumsqr(ca.sin(X)) * X[0], X)[0],
}


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_expression(name):
    assert_agrees(ca.Function("f", SYMBOLS, [EXPRESSIONS[name]]))


def test_all_at_once():
    """With places in memory used again, and results that share."""
    assert_agrees(ca.Function("f", SYMBOLS, list(EXPRESSIONS.values())))


@pytest.mark.parametrize("name", ["cases", "product", "norm inf", "largest", "smallest", "set"])
def test_all_pairs_of_special_numbers(name):
    function = ca.Function("f", SYMBOLS, [EXPRESSIONS[name]])
    compiled(function)
    for i, a in enumerate(SPECIAL):
        for b in SPECIAL[i:]:
            values = [np.resize([a, b, b, a, a], s.nnz()) for s in SYMBOLS]
            assert_same_bits(*both(function, *values))


@pytest.mark.parametrize(("name", "sign"), [("largest", -1.0), ("smallest", 1.0)])
def test_zeros_that_are_not_stored_count(name, sign):
    stored = sign * np.array([3.0, 0.5, 2.0, 7.0])
    function = ca.Function("f", [HOLES], [EXPRESSIONS[f"{name} of sparse"]])
    found, expected = both(function, stored)
    assert found == expected == 0.0
    function = ca.Function("f", [A], [EXPRESSIONS[name]])
    found, expected = both(function, sign * np.arange(1.0, 13.0))
    assert found == expected == sign


def test_result_may_be_the_argument():
    function = ca.Function("f", [X], [ca.vertcat(X[3], X[:3])])
    block = np.array([1.0, 2.0, 3.0, 4.0])
    evaluate = compiled(function).bind([block], [block])
    evaluate()
    evaluate()
    np.testing.assert_array_equal(block, [3.0, 4.0, 1.0, 2.0])


@pytest.mark.parametrize(
    ("expression", "reason"),
    [
        (ca.erfinv(X), "operation OP_ERFINV"),
        (ca.solve(A[:, :3], X[:3]), "operation OP_SOLVE"),
        (ca.logsumexp(X), "operation OP_LOGSUMEXP"),
        (X.monitor("x"), "operation OP_MONITOR"),
        (ca.bspline(Y, ca.DM([0.0, 1.0]), [[0.0, 0.0, 1.0, 1.0]], [1], 1), "operation OP_BSPLINE"),
    ],
)
def test_what_is_left_to_the_interpreter(expression, reason):
    assert reason in (why_not(ca.Function("f", SYMBOLS, [expression])) or "")
