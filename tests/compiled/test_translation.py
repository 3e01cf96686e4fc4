"""Functions that call functions, against the interpreter."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.compiled.native_code import why_not
from pfsc_drake.compiled.translation import translate
from tests.compiled.interpreter import SPECIAL, assert_agrees, compiled

S, U = ca.SX.sym("s", 2), ca.SX.sym("u")
X, Y = ca.MX.sym("x", 4), ca.MX.sym("y")
SCALARS = ca.Function("scalars", [S, U], [ca.sin(S) * U, S[0] / S[1]])
MATRICES = ca.Function("matrices", [X, Y], [X[1:] * Y, SCALARS(X[:2], Y)[0]])
SPARSE = ca.Function("sparse", [S, U], [ca.diag(S) * U, ca.vertcat(U, ca.SX(1, 1), S[0])])
STEP = ca.Function("step", [S, U], [ca.vertcat(S[1], S[0] * U), S[0] + U])
UP = ca.Function("up", [X], [X + 1.0])
DOWN = ca.Function("down", [X], [X[::-1] - 1.0])
NOTHING = ca.Function("nothing", [X], [ca.MX(4, 1)])


def shared():
    """A function whose arguments and results lie within others."""
    first, second = MATRICES(X, Y)
    third, _ = MATRICES(ca.vertcat(first, second[0]), second[1])
    return ca.vertcat(first, third, second)


EXPRESSIONS = {
    "scalars": ca.vertcat(*SCALARS(X[1:3], Y)),
    "one result": SCALARS(X[1:3], Y)[1],
    "constant arguments": SCALARS(ca.DM([1.0, 2.0]), 3.0)[0] + X[:2],
    "zero arguments": SCALARS(ca.MX(2, 1), Y)[0],
    "nested": MATRICES(X, Y)[1],
    "shared": shared(),
    "same function twice": SCALARS(SCALARS(X[:2], Y)[0], X[3])[0],
    "sparse results": SPARSE(X[:2], Y)[0] @ X[2:],
    "sparse vector": SPARSE(X[:2], Y)[1],
    "map": SCALARS.map(2)(ca.reshape(X, 2, 2), ca.horzcat(Y, 2.0))[0],
    "map of one": SCALARS.map(1)(X[:2], Y)[1],
    "map of many": MATRICES.map(30)(ca.repmat(X, 1, 30), ca.DM(range(30)).T * Y)[0],
    "map of a constant": SCALARS.map("m", "serial", 3, [1], [1])(ca.DM.ones(2, 3), Y)[0],
    "mapaccum": STEP.mapaccum(5)(X[:2], ca.repmat(Y, 1, 5))[0],
    "fold": STEP.fold(8)(X[:2], ca.repmat(Y, 1, 8))[0],
    "if": ca.if_else(Y > 0.5, ca.sin(X), X / Y, True),
    "if of functions": ca.Function.if_else("if", UP, DOWN)(Y > 0.5, X),
    "conditional": ca.conditional(Y, [X, X + 1.0, X * Y], X - 1.0, True),
    "switch": ca.Function.conditional("switch", [UP, DOWN, UP], DOWN)(Y, X),
    "switch of sparse": ca.Function.conditional("switch", [UP, NOTHING], DOWN)(Y, X),
    "switch within a map": ca.Function(
        "s", [Y, X], [ca.if_else(Y > 0.0, UP(X), DOWN(X), True)]
    ).map(3)(ca.horzcat(Y, 1.0, -Y), ca.repmat(X, 1, 3)),
    "table within a function": ca.Function(
        "t", [Y], [ca.MX(ca.DM([3.0, 1.0, 2.0]))[ca.low(ca.DM([0.0, 1.0, 2.0]), Y)]]
    )(X[0] + Y),
    "derivative of a call": ca.jacobian(SCALARS(X[:2], Y)[0], X),
    "derivative of a map": ca.jacobian(
        SCALARS.map(2)(ca.reshape(X, 2, 2), ca.horzcat(Y, 2.0))[0], X
    ),
    "derivative of a switch": ca.jacobian(ca.if_else(Y > 0.5, ca.sin(X), X / Y, True), X),
}


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_calls(name):
    assert_agrees(ca.Function("f", [X, Y], [EXPRESSIONS[name]]))


def test_all_at_once():
    assert_agrees(ca.Function("f", [X, Y], list(EXPRESSIONS.values())))


def test_sparse_cases_of_a_switch_take_sparse_arguments():
    lower = ca.MX.sym("l", ca.Sparsity.lower(3))
    diagonal = ca.MX.sym("d", ca.Sparsity.diag(3))
    cases = [
        ca.Function("lower", [lower, Y], [lower.T, Y]),
        ca.Function("diagonal", [diagonal, Y], [diagonal * Y, 2.0 * Y]),
    ]
    switch = ca.Function.conditional("switch", [cases[0]], cases[1])
    assert switch.info()["project_in"]
    assert switch.info()["project_out"]
    assert_agrees(switch)


def test_no_arguments_and_no_results():
    assert_agrees(ca.Function("f", [], [ca.MX(3.0), ca.MX(0, 1)]), rounds=1)
    compiled(ca.Function("f", [X], [])).bind([np.zeros(4)], [])()


def test_each_function_is_translated_once():
    text = translate(ca.Function("f", [X, Y], [EXPRESSIONS["shared"]]))
    # these, those of matrices, scalars and the entry
    assert text.count("define") == 4


def test_a_table_is_there_once():
    table = ca.MX(ca.DM(np.arange(50.0)))
    one = ca.Function("one", [Y], [table[Y]])
    text = translate(ca.Function("f", [Y], [one(Y), table[2.0 * Y]]))
    assert text.count("constant [400 x i8]") == 1


def test_a_table_of_all_kinds_of_numbers():
    """To the last bit, also where its numbers are taken one by one, or changed."""
    table = ca.MX(ca.DM(SPECIAL))
    assert_agrees(ca.Function("f", [Y], [table[Y], table[5], table[3:9].T, 2.0 * table]))


def test_functions_of_the_same_name_and_shape_are_distinguished():
    up, down = (ca.Function("f", [Y], [Y + step]) for step in (1.0, -1.0))
    assert_agrees(ca.Function("g", [Y], [up(Y), down(Y), up(2.0 * Y)]))


def test_functions_of_the_same_content_are_translated_once():
    one, two = (ca.Function("f", [Y], [Y + 1.0]) for _ in range(2))
    text = translate(ca.Function("g", [Y], [one(Y) * two(2.0 * Y)]))
    assert text.count("define") == 3


def test_long_functions_are_split_into_blocks():
    x = ca.SX.sym("x", 300)
    function = ca.Function("f", [x], [ca.sin(x) * ca.cumsum(x > 0.0)])
    assert translate(function).count("br label") > 5
    assert_agrees(function, rounds=4)


@pytest.mark.parametrize(
    ("expression", "reason"),
    [
        (ca.Function("g", [X], [ca.erfinv(X)])(X), "operation OP_ERFINV"),
        (ca.Function("g", [X], [UP(X)]).map(2, "openmp")(ca.repmat(X, 1, 2)), "a OmpMap"),
        (ca.rootfinder("r", "newton", SCALARS.slice("g", [0, 1], [0]))(X[:2], Y), "a Newton"),
    ],
)
def test_what_is_left_to_the_interpreter(expression, reason):
    assert reason in (why_not(ca.Function("f", [X, Y], [expression])) or "")


def test_functions_that_call_each_other_deeply():
    function = UP
    for _ in range(60):
        function = ca.Function("outer", [X], [function(X) * 0.5])
    compiled(function)
    assert_agrees(function, rounds=3)
