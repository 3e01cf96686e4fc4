"""Code that is made late against the interpreter's and machine code."""

from collections import Counter

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.compiled import bound_function
from pfsc_drake.compiled.bound_function import BoundFunction
from tests import deferred_code
from tests.deferred_code import BATCH, DeferredCode, compiled_at_once, interpreted

A, X = ca.SX.sym("A", 2, 2), ca.SX.sym("x", 2)
FUNCTION = ca.Function("f", [A, X], [A @ X, ca.sin(X)], ["A", "x"], ["y", "s"])


@pytest.fixture
def evaluations(monkeypatch):
    """Return how often all functions have been evaluated; two batches are enough."""
    monkeypatch.setattr(deferred_code, "_evaluations", evaluations := Counter())
    monkeypatch.setattr(deferred_code, "ENOUGH", 2 * BATCH)
    return evaluations


def evaluate(bound, k):
    a, x = np.array([[1.0, k], [-k, 0.5]]), np.array([0.1 * k, 2.0])
    bound.arguments["A"][:], bound.arguments["x"][:] = a.ravel(order="F"), x
    bound.evaluate()
    np.testing.assert_allclose(bound.results["y"], a @ x, rtol=1e-15)
    np.testing.assert_allclose(bound.results["s"], np.sin(x), rtol=1e-15)


def test_results_before_and_after_it_is_made(monkeypatch, evaluations):
    made = []
    original = deferred_code.native_code
    monkeypatch.setattr(deferred_code, "native_code", lambda f: made.append(f) or original(f))
    bound = BoundFunction(FUNCTION)
    for k in range(3 * BATCH):
        evaluate(bound, k)
        assert len(made) == (k >= 2 * BATCH - 1)


def test_evaluations_of_the_same_content_count_together(monkeypatch, evaluations):
    made = []
    monkeypatch.setattr(deferred_code, "native_code", made.append)
    for again in (False, True):
        bound = BoundFunction(ca.Function("f", [A, X], [A @ X, ca.sin(X)], ["A", "x"], ["y", "s"]))
        for k in range(BATCH):
            evaluate(bound, k)
        assert bool(made) == again
    assert evaluations.total() == 2 * BATCH


def test_what_cannot_be_compiled_stays_interpreted(monkeypatch, evaluations):
    monkeypatch.setattr(deferred_code, "native_code", lambda f: None)
    bound = BoundFunction(FUNCTION)
    for k in range(3 * BATCH):
        evaluate(bound, k)


def test_only_within_a_context_it_is_made_at_once_or_never():
    assert bound_function.native_code is DeferredCode
    with compiled_at_once():
        assert bound_function.native_code is deferred_code.native_code
    with interpreted():
        assert bound_function.native_code(FUNCTION) is None
    assert bound_function.native_code is DeferredCode
