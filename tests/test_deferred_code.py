"""Code that is made late against the interpreter's and machine code."""

import casadi as ca
import numpy as np

from pfsc_drake.compiled import bound_function
from pfsc_drake.compiled.bound_function import BoundFunction
from tests import deferred_code
from tests.deferred_code import MANY, DeferredCode, compiled_at_once

A, X = ca.SX.sym("A", 2, 2), ca.SX.sym("x", 2)
FUNCTION = ca.Function("f", [A, X], [A @ X, ca.sin(X)], ["A", "x"], ["y", "s"])


def test_results_before_and_after_it_is_made(monkeypatch):
    made = []
    original = deferred_code.native_code
    monkeypatch.setattr(deferred_code, "native_code", lambda f: made.append(f) or original(f))
    bound = BoundFunction(FUNCTION)
    for k in range(MANY + 2):
        a, x = np.array([[1.0, k], [-k, 0.5]]), np.array([0.1 * k, 2.0])
        bound.arguments["A"][:], bound.arguments["x"][:] = a.ravel(order="F"), x
        bound.evaluate()
        assert len(made) == (k >= MANY - 1)
        np.testing.assert_allclose(bound.results["y"], a @ x, rtol=1e-15)
        np.testing.assert_allclose(bound.results["s"], np.sin(x), rtol=1e-15)


def test_what_cannot_be_compiled_stays_interpreted(monkeypatch):
    monkeypatch.setattr(deferred_code, "native_code", lambda f: None)
    bound = BoundFunction(FUNCTION)
    bound.arguments["x"][:] = 0.5
    for _ in range(MANY + 2):
        bound.evaluate()
    assert bound.results["s"][0] == np.sin(0.5)


def test_only_within_the_context_it_is_made_at_once():
    assert bound_function.native_code is DeferredCode
    with compiled_at_once():
        assert bound_function.native_code is deferred_code.native_code
    assert bound_function.native_code is DeferredCode
