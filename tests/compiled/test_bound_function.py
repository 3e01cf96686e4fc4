"""The bound function against an ordinary call of the same function."""

import sys

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.compiled import native_code
from pfsc_drake.compiled.bound_function import BoundFunction, compiled_when_bound

A, B = ca.SX.sym("A", 2, 3), ca.SX.sym("b", 3)
FUNCTION = ca.Function("f", [A, B], [A @ B, ca.sin(A)], ["A", "b"], ["product", "sine"])


@pytest.fixture(name="compile_after", params=[0, 3, 10**9])
def fixture_compile_after(request, monkeypatch):
    monkeypatch.setattr(BoundFunction, "compile_after", request.param)
    return request.param


@pytest.fixture(name="no_llvmlite")
def fixture_no_llvmlite(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(native_code, "_compiled", {})
    native_code._llvm.cache_clear()
    for name in ("llvmlite", "llvmlite.binding"):
        monkeypatch.setitem(sys.modules, name, None)


def check_values(bound, rounds=6):
    rng = np.random.default_rng(0)
    for _ in range(rounds):
        a, b = rng.standard_normal((2, 3)), rng.standard_normal(3)
        bound.arguments["A"][:], bound.arguments["b"][:] = a.ravel(order="F"), b
        bound.evaluate()
        np.testing.assert_allclose(bound.results["product"], a @ b, rtol=1e-15)
        np.testing.assert_allclose(bound.results["sine"], np.sin(a).ravel(order="F"), rtol=1e-15)


def test_values_by_columns(compile_after):
    check_values(BoundFunction(FUNCTION))


def test_values_without_llvmlite(compile_after, no_llvmlite):
    bound = BoundFunction(FUNCTION)
    check_values(bound)
    assert not bound.compile()


def test_shared_arrays_need_no_copy(compile_after):
    block = np.zeros(5)
    first = BoundFunction(FUNCTION, b=block[:3], product=block[3:])
    second = BoundFunction(FUNCTION, b=block[:3])
    block[:3] = 1.0, 2.0, 3.0
    first.arguments["A"][:] = second.arguments["A"][:] = 1.0
    first.evaluate()
    second.evaluate()
    np.testing.assert_array_equal(block[3:], [6.0, 6.0])
    np.testing.assert_array_equal(second.results["product"], [6.0, 6.0])


def test_compiles_when_it_pays_and_once(monkeypatch):
    asked = []
    monkeypatch.setattr("pfsc_drake.compiled.bound_function.native_code", asked.append)
    monkeypatch.setattr(BoundFunction, "compile_after", 4)
    bound = BoundFunction(FUNCTION)
    counts = []
    for _ in range(7):
        bound.evaluate()
        counts.append(len(asked))
    assert counts == [0, 0, 0, 0, 1, 1, 1]


def test_a_method_that_was_kept_uses_machine_code(monkeypatch):
    bound = BoundFunction(FUNCTION)
    evaluate = bound.evaluate
    assert bound.compile()
    monkeypatch.setattr(bound, "_buffer", None)
    bound.arguments["A"][:] = bound.arguments["b"][:] = 1.0
    del bound
    evaluate()
    np.testing.assert_array_equal(evaluate.__self__.results["product"], [3.0, 3.0])


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


def test_compiled_when_bound(monkeypatch):
    asked = []
    monkeypatch.setattr("pfsc_drake.compiled.bound_function.native_code", asked.append)
    with pytest.raises(RuntimeError), compiled_when_bound():
        BoundFunction(FUNCTION)
        raise RuntimeError
    BoundFunction(FUNCTION)
    assert len(asked) == 1
