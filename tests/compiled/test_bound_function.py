"""The bound function against an ordinary call of the same function."""

import gc

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.compiled import bound_function
from pfsc_drake.compiled.bound_function import BoundFunction

A, B = ca.SX.sym("A", 2, 3), ca.SX.sym("b", 3)
FUNCTION = ca.Function("f", [A, B], [A @ B, ca.sin(A)], ["A", "b"], ["product", "sine"])


@pytest.fixture(name="code", params=["machine code", "interpreter"])
def fixture_code(request, monkeypatch):
    if request.param == "interpreter":
        monkeypatch.setattr(bound_function, "native_code", lambda _: None)


def check_values(bound, rounds=6):
    rng = np.random.default_rng(0)
    for _ in range(rounds):
        a, b = rng.standard_normal((2, 3)), rng.standard_normal(3)
        bound.arguments["A"][:], bound.arguments["b"][:] = a.ravel(order="F"), b
        bound.evaluate()
        np.testing.assert_allclose(bound.results["product"], a @ b, rtol=1e-15)
        np.testing.assert_allclose(bound.results["sine"], np.sin(a).ravel(order="F"), rtol=1e-15)


def test_values_by_columns(code):
    check_values(BoundFunction(FUNCTION))


def test_shared_arrays_need_no_copy(code):
    block = np.zeros(5)
    first = BoundFunction(FUNCTION, b=block[:3], product=block[3:])
    second = BoundFunction(FUNCTION, b=block[:3])
    block[:3] = 1.0, 2.0, 3.0
    first.arguments["A"][:] = second.arguments["A"][:] = 1.0
    first.evaluate()
    second.evaluate()
    np.testing.assert_array_equal(block[3:], [6.0, 6.0])
    np.testing.assert_array_equal(second.results["product"], [6.0, 6.0])


def test_it_is_compiled_when_bound(monkeypatch):
    compiled_names = []
    monkeypatch.setattr(bound_function, "native_code", compiled_names.append)
    bound = BoundFunction(FUNCTION)
    assert len(compiled_names) == 1
    check_values(bound)
    assert len(compiled_names) == 1


def test_evaluate_keeps_code_and_arrays_alive(code):
    bound = BoundFunction(FUNCTION)
    evaluate, product = bound.evaluate, bound.results["product"]
    bound.arguments["A"][:] = bound.arguments["b"][:] = 1.0
    del bound
    gc.collect(1)  # of all that a process has it takes seconds
    evaluate()
    np.testing.assert_array_equal(product, [3.0, 3.0])


@pytest.mark.parametrize(
    "array", [np.zeros(4), np.zeros(3, dtype=np.float32), np.zeros(6)[::2]], ids=str
)
def test_refuses_an_array_that_does_not_fit(array):
    with pytest.raises(ValueError, match=r"b: array of .* must be 3 contiguous doubles"):
        BoundFunction(FUNCTION, b=array)


def test_refuses_sparse_results():
    x = ca.SX.sym("x", 2)
    with pytest.raises(ValueError, match=r"y: has .* must be dense"):
        BoundFunction(ca.Function("f", [x], [ca.diag(x)], ["x"], ["y"]))
