"""Tables and computed indices against the interpreter."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.compiled.native_code import why_not
from tests.compiled.interpreter import assert_agrees, assert_same_bits, both

X, V, K, J = ca.MX.sym("x", 6), ca.MX.sym("v", 2), ca.MX.sym("k", 2), ca.MX.sym("j", 3)
A = ca.MX.sym("A", 3, 4)
TABLE = ca.MX(ca.DM(np.linspace(-2.0, 3.0, 7) ** 3))
LONG = ca.MX(ca.DM(np.sort(np.random.default_rng(0).uniform(-3.0, 7.0, 150))))


def assigned(add):
    x = ca.MX(X)
    x.nz[K] = V + (x.nz[K] if add else 0.0)
    return x


READ = {
    "table": TABLE[ca.low(TABLE, V)],
    "argument": X[K],
    "result": ca.sin(X)[K],
    "constants and numbers": ca.vertcat(X, 1.0, V)[K],
    "part of an argument": X[1:4][K],
    "one element": V[1][K],
    "rows of columns": A[K, J],
    "rows of a slice": A[K, 1:3],
    "columns of a slice": A[::2, J],
    "rows of a table": ca.reshape(LONG, 10, 15)[:, K[0]],
    "twice": X[X[K]],
}


@pytest.mark.parametrize("name", READ)
def test_read(name):
    assert_agrees(ca.Function("f", [X, V, K, J, A], [READ[name]]))


def derivative(expression):
    """Return a product of the Jacobian, which adds at computed indices."""
    return ca.jtimes(expression, X, ca.vertcat(V, V, 1.0)[: expression.numel()], True)


WRITTEN = {
    "assigned": assigned(add=False),
    "added": assigned(add=True),
    "derivative of read elements": derivative(ca.sin(X)[K]),
    "derivative of elements read twice": derivative(X[ca.vertcat(K, K)] ** 2),
    "read again": assigned(add=False)[J] + X[J],
}


@pytest.mark.parametrize("name", WRITTEN)
def test_written(name):
    assert_agrees(ca.Function("f", [X, V, K, J, A], [WRITTEN[name]]))


def test_indices_that_fit_no_integer():
    function = ca.Function("f", [X, K], [X[K]])
    for odd in (np.nan, np.inf, -np.inf, 1e19, -1e19, 9.3e18, 2.0**63, -(2.0**63), 5.99, -0.99):
        assert_same_bits(*both(function, np.arange(6.0), [odd, 1.0]))


@pytest.mark.parametrize("mode", ["linear", "binary", "exact", "auto"])
@pytest.mark.parametrize("grid", [TABLE, LONG, LONG[:2], LONG[:3]], ids=[7, 150, 2, 3])
def test_look_up(grid, mode):
    x = ca.MX.sym("x", 40)
    function = ca.Function("f", [x], [ca.low(grid, x, {"lookup_mode": mode})])
    values = np.array(ca.evalf(grid)).ravel()
    points = [*values, *np.nextafter(values, 9.0), *np.nextafter(values, -9.0), 0.0, -0.0]
    odd = [np.nan, np.inf, -np.inf, 1e300, -1e300]
    for chunk in range(0, len(points), 35):
        assert_same_bits(*both(function, np.resize([*points[chunk : chunk + 35], *odd], 40)))


@pytest.mark.parametrize("mode", ["linear", "binary", "exact"])
def test_look_up_in_an_argument(mode):
    x = ca.MX.sym("x", 5)
    assert_agrees(ca.Function("f", [x, V], [ca.low(x, V, {"lookup_mode": mode})]))


def test_modes_are_not_mixed_up():
    modes = ["exact", "binary", "linear", "exact", "linear"]
    grid = ca.MX(ca.DM([0.0, 5.0, 1.0, 6.0, 2.0, 8.0]))
    points = [ca.low(grid, V, {"lookup_mode": mode}) for mode in modes]
    inner = ca.Function("inner", [V], points[:3])
    assert_agrees(ca.Function("f", [V], [*points[2:], *inner(V + 1.0)]), rounds=100)


def test_what_is_left_to_the_interpreter():
    rows = ca.jtimes(A[K, 1:3], A, A[:2, :2], True)
    reason = why_not(ca.Function("f", [X, V, K, J, A], [rows]))
    assert reason == "assignment at several computed indices"
