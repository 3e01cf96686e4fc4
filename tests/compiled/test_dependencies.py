"""Dependencies against what changes when arguments change."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.compiled.dependencies import dependencies, nonzero_dependencies

X, Y, A = ca.MX.sym("x", 4), ca.MX.sym("y"), ca.MX.sym("A", 2, 2)
S = ca.SX.sym("s", 2)
TABLE = ca.MX(ca.DM([0.0, 0.3, 0.9, 2.5]))
TWICE = ca.Function("twice", [S], [2.0 * S, S[0]])
SINE = ca.Function("sine", [S], [ca.sin(S[::-1]), S[1]])
STEP = ca.Function("step", [S, ca.SX.sym("u")], [S[::-1] + 1.0, S[0]])
CASES = ca.Function.conditional("cases", [TWICE], SINE)


def with_one_replaced():
    x = ca.MX(X)
    x.nz[ca.floor(Y)] = 7.0
    return x


MATRIX_EXPRESSIONS = {
    "table": TABLE[ca.low(TABLE, Y)],
    "place in a table": ca.low(TABLE, ca.vertcat(Y, A[0, 1])),
    "constant": ca.MX(3.0),
    "floor": ca.floor(X[:2]),
    "cases of a matrix": ca.if_else(Y > 0.5, X[0], X[1]),
    "cases, short-circuited": ca.if_else(Y > 0.5, X[0], X[1], True),
    "product": A @ X[:2],
    "row of a product": (A @ X[:2])[1],
    "norm": ca.norm_2(X[1:]),
    "largest": ca.mmax(X[:3]),
    "vertcat": ca.vertcat(X[2:], ca.vec(A.T), Y),
    "split": ca.vertsplit(X, [0, 1, 4])[1],
    "scalar and matrix": Y * A,
    "call": TWICE(X[1:3])[0],
    "one result of a call": SINE(X[1:3])[1],
    "switch": CASES(Y, X[:2])[0],
    "map": TWICE.map(2)(ca.reshape(X, 2, 2))[0],
    "fold": STEP.fold(3)(X[:2], X[1:].T)[0],
    "repeated": ca.repmat(X[:2], 1, 2),
    "diagonal": ca.diagcat(Y, A[0, 0]),
    "set": ca.vertcat(X, 0.0)[[4, 0]],
}
COMPUTED_INDICES = {
    "place in a changing table": ca.low(ca.cumsum(X), ca.vertcat(Y, A[0, 1])),
    "element": X[ca.floor(Y)],
    "replaced": with_one_replaced(),
    "first that is not zero": ca.find(ca.floor(X)),
}


def what_changes(function, rng, rounds=40):
    """Return which results change with which arguments, element by element, at random places."""
    n_in = sum(function.nnz_in(i) for i in range(function.n_in()))
    ends = np.cumsum([function.nnz_in(i) for i in range(function.n_in())])[:-1]

    def evaluate(values):
        parts = np.split(values, ends)
        arguments = [ca.DM(function.sparsity_in(i), part) for i, part in enumerate(parts)]
        return np.concatenate([np.array(r.nonzeros()) for r in function.call(arguments)])

    changed = np.zeros((len(evaluate(np.zeros(n_in))), n_in), dtype=bool)
    for _ in range(rounds):
        values = rng.uniform(0.0, 3.0, n_in)
        before = evaluate(values)
        for i in range(n_in):
            other = values.copy()
            other[i] = rng.uniform(0.0, 3.0)
            changed[:, i] |= evaluate(other) != before
    return changed


@pytest.mark.parametrize("name", MATRIX_EXPRESSIONS)
def test_elements_of_matrix_expressions(name):
    function = ca.Function("f", [X, Y, A], [MATRIX_EXPRESSIONS[name]])
    found = nonzero_dependencies(function).toarray()
    np.testing.assert_array_equal(found, what_changes(function, np.random.default_rng(0)))


@pytest.mark.parametrize("name", COMPUTED_INDICES)
def test_computed_indices_may_reach_everything(name):
    function = ca.Function("f", [X, Y, A], [COMPUTED_INDICES[name]])
    found = nonzero_dependencies(function).toarray()
    changes = what_changes(function, np.random.default_rng(0))
    assert changes.any()
    assert not (changes & ~found).any()
    assert not found[:, [5, 6, 8]].any()


def scalar_expressions():
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y")
    return ca.Function(
        "f",
        [x, y],
        [ca.floor(x), x > y, ca.if_else(y > 1.0, x[0], 1.0), ca.fmod(y, 0.5), ca.sign(x - 1.0)],
    )


def all_results():
    return ca.Function("f", [X, Y, A], [*MATRIX_EXPRESSIONS.values(), *COMPUTED_INDICES.values()])


@pytest.mark.parametrize("build", [scalar_expressions, all_results])
def test_every_argument_of_every_result(build):
    function = build()
    changes = what_changes(function, np.random.default_rng(1))
    rows = np.split(changes, np.cumsum([function.nnz_out(i) for i in range(function.n_out())])[:-1])
    ends = np.cumsum([function.nnz_in(i) for i in range(function.n_in())])[:-1]
    expected = [[block.any() for block in np.split(row, ends, axis=1)] for row in rows]
    np.testing.assert_array_equal(dependencies(function), expected)


def test_what_is_called_by_what_is_called():
    inner = ca.Function("inner", [X, Y, A], [TABLE[ca.low(TABLE, X[1])], A])
    x, unused = ca.MX.sym("x", 4), ca.MX.sym("unused")
    outer = ca.Function("outer", [unused, x], [*inner(x, unused, ca.MX(2, 2)), x[2]])
    np.testing.assert_array_equal(
        nonzero_dependencies(outer).toarray(),
        [[0, 0, 1, 0, 0], *[[0] * 5] * 4, [0, 0, 0, 1, 0]],
    )


def test_sparse_arguments_and_no_results():
    x = ca.MX.sym("x", ca.Sparsity.lower(2))
    function = ca.Function("f", [x], [x.T, ca.MX(0, 1)])
    np.testing.assert_array_equal(nonzero_dependencies(function).toarray(), np.eye(3, dtype=bool))
    np.testing.assert_array_equal(dependencies(function), [[True], [False]])


def test_unknown_kinds_depend_on_everything():
    x = ca.SX.sym("x", 2)
    solver = ca.rootfinder("r", "newton", ca.Function("g", [x, S[0]], [x - S[0]]))
    assert dependencies(solver).all()
