"""Code that is made late against the interpreter's and machine code."""

from collections import Counter
from itertools import count
from types import SimpleNamespace

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
def slow_clock(monkeypatch):
    """Let an evaluation take 1 s; two batches are enough."""
    monkeypatch.setattr(deferred_code, "_batches", Counter())
    monkeypatch.setattr(deferred_code, "_least", {})
    monkeypatch.setattr(deferred_code, "time", SimpleNamespace(thread_time=count().__next__))
    monkeypatch.setattr(deferred_code, "ENOUGH", 1.5 * BATCH)


def evaluate(bound, k):
    a, x = np.array([[1.0, k], [-k, 0.5]]), np.array([0.1 * k, 2.0])
    bound.arguments["A"][:], bound.arguments["x"][:] = a.ravel(order="F"), x
    bound.evaluate()
    np.testing.assert_allclose(bound.results["y"], a @ x, rtol=1e-15)
    np.testing.assert_allclose(bound.results["s"], np.sin(x), rtol=1e-15)


@pytest.mark.usefixtures("slow_clock")
def test_results_before_and_after_it_is_made(monkeypatch):
    made = []
    original = deferred_code.native_code
    monkeypatch.setattr(deferred_code, "native_code", lambda f: made.append(f) or original(f))
    bound = BoundFunction(FUNCTION)
    for k in range(3 * BATCH):
        evaluate(bound, k)
        assert len(made) == (k >= 2 * BATCH - 1)


@pytest.mark.usefixtures("slow_clock")
def test_evaluations_of_the_same_content_count_together(monkeypatch):
    made = []
    monkeypatch.setattr(deferred_code, "native_code", made.append)
    for again in (False, True):
        bound = BoundFunction(ca.Function("f", [A, X], [A @ X, ca.sin(X)], ["A", "x"], ["y", "s"]))
        for k in range(BATCH):
            evaluate(bound, k)
        assert bool(made) == again


@pytest.mark.usefixtures("slow_clock")
def test_what_cannot_be_compiled_stays_interpreted(monkeypatch):
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


@pytest.mark.usefixtures("slow_clock")
def test_an_evaluation_that_was_disturbed_does_not_count_for_others(monkeypatch):
    """The third one that is looked at takes a thousand times as long as others."""
    made, times = [], iter([0.0, 0.1, 1.0, 1.1, 2.0, 102.0, 103.0, 103.1])
    monkeypatch.setattr(deferred_code.time, "thread_time", times.__next__)
    monkeypatch.setattr(deferred_code, "native_code", made.append)
    bound = BoundFunction(FUNCTION)
    for k in range(4 * BATCH):
        evaluate(bound, k)
    assert not made
