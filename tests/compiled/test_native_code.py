"""Machine code against CasADi's interpreter, and single operations against Python's library."""

import gc
import math
import operator
import sys

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pfsc_drake.compiled import native_code as module
from pfsc_drake.compiled.native_code import native_code, translate

SPECIAL = [0.0, 1.0, 0.5, 2.0, 3.0, 1e-3, 0.7, math.pi, 1e10, 5e-324, 1e-310, 1e308, math.inf]
SPECIAL = [*SPECIAL, *[-x for x in SPECIAL], math.nan, -math.nan]
TAME = [0.0, -0.0, 0.3, -0.3, 0.9, 1.0, -1.0, 1.7, -1.7, 2.5, -2.5, 11.0]

UNARY = {
    "neg": (operator.neg, operator.neg),
    "sq": (lambda x: x * x, lambda x: x * x),
    "twice": (lambda x: 2 * x, lambda x: x + x),
    "inv": (lambda x: 1 / x, lambda x: x**-1.0),
    "sqrt": (ca.sqrt, math.sqrt),
    "fabs": (ca.fabs, math.fabs),
    "sign": (ca.sign, lambda x: math.copysign(1.0, x) if x else x),
    "floor": (ca.floor, lambda x: float(math.floor(x))),
    "ceil": (ca.ceil, lambda x: float(math.ceil(x))),
    "not": (ca.logic_not, lambda x: float(not x)),
    **{
        name: (getattr(ca, name), getattr(math, name))
        for name in (
            "exp",
            "log",
            "sin",
            "cos",
            "tan",
            "asin",
            "acos",
            "atan",
            "sinh",
            "cosh",
            "tanh",
            "asinh",
            "acosh",
            "atanh",
            "erf",
            "log1p",
            "expm1",
        )
    },
}
BINARY = {
    "add": (operator.add, operator.add),
    "sub": (operator.sub, operator.sub),
    "mul": (operator.mul, operator.mul),
    "div": (operator.truediv, operator.truediv),
    "lt": (operator.lt, lambda x, y: float(x < y)),
    "le": (operator.le, lambda x, y: float(x <= y)),
    "eq": (operator.eq, lambda x, y: float(x == y)),
    "ne": (operator.ne, lambda x, y: float(x != y)),
    "and": (ca.logic_and, lambda x, y: float(bool(x) and bool(y))),
    "or": (ca.logic_or, lambda x, y: float(bool(x) or bool(y))),
    "if_else_zero": (lambda x, y: ca.if_else(x, y, 0.0), lambda x, y: y if x else 0.0),
    "fmin": (ca.fmin, min),
    "fmax": (ca.fmax, max),
    "fmod": (ca.fmod, math.fmod),
    "remainder": (ca.remainder, math.remainder),
    "copysign": (ca.copysign, math.copysign),
    "pow": (operator.pow, math.pow),
    "atan2": (ca.atan2, math.atan2),
    "hypot": (ca.hypot, math.hypot),
}


def compiled(function):
    pytest.importorskip("llvmlite")
    code = native_code(function)
    assert code is not None
    return code


def both(function, *values):
    """Return the flat results of machine code and interpreter."""
    code = compiled(function)
    arguments = [np.array(v, dtype=float).ravel(order="F") for v in values]
    results = [np.full(function.nnz_out(i), 7.0) for i in range(function.n_out())]
    code.bind(arguments, results)()
    buffer, evaluate = function.buffer()
    expected = [np.full(function.nnz_out(i), 8.0) for i in range(function.n_out())]
    for i, a in enumerate(arguments):
        buffer.set_arg(i, a.data)
    for i, r in enumerate(expected):
        buffer.set_res(i, r.data)
    evaluate()
    return np.concatenate(results), np.concatenate(expected)


def assert_same_bits(actual, expected):
    is_nan = np.isnan(expected)
    np.testing.assert_array_equal(np.isnan(actual), is_nan)
    np.testing.assert_array_equal(
        actual[~is_nan].view(np.uint64), expected[~is_nan].view(np.uint64)
    )


def function_of(expression, *symbols):
    return ca.Function("f", list(symbols), [ca.densify(ca.SX(expression))])


@pytest.mark.parametrize("name", UNARY)
def test_unary_operation(name):
    build, reference = UNARY[name]
    x = ca.SX.sym("x", 60)
    function = function_of(build(x), x)
    actual, expected = both(function, np.resize(SPECIAL, 60))
    assert_same_bits(actual, expected)
    values = np.resize(TAME, 60)
    actual, expected = both(function, values)
    assert_same_bits(actual, expected)
    for value, result in zip(values.tolist(), actual, strict=True):
        try:
            wanted = reference(value)
        except (ValueError, ZeroDivisionError):
            continue
        assert result == pytest.approx(wanted, rel=4e-16, abs=0)


@pytest.mark.parametrize("name", BINARY)
def test_binary_operation(name):
    build, reference = BINARY[name]
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    function = function_of(build(x, y), x, y)
    for a in SPECIAL:
        for b in SPECIAL:
            assert_same_bits(*both(function, a, b))
    for a in TAME:
        for b in TAME:
            actual, expected = both(function, a, b)
            assert_same_bits(actual, expected)
            try:
                wanted = reference(a, b)
            except (ValueError, ZeroDivisionError):
                continue
            assert actual[0] == pytest.approx(wanted, rel=4e-16, abs=0)


def test_every_known_operation_is_tested():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    functions = [function_of(build(x), x) for build, _ in UNARY.values()]
    functions += [function_of(build(x, y), x, y) for build, _ in BINARY.values()]
    functions += [function_of(x**2.7, x)]
    used = {f.instruction_id(k) for f in functions for k in range(f.n_instructions())}
    known = {*module._INLINE, *module._UNARY_CALLS, *module._BINARY_CALLS}
    assert known <= used


@pytest.mark.parametrize("exponent", [0.5, 1.5, 2.7, -1.0, -0.5, 3.0, 1.0 / 3.0, 20.0])
def test_power_with_constant_exponent(exponent):
    x = ca.SX.sym("x", 60)
    assert_same_bits(*both(function_of(x**exponent, x), np.resize(SPECIAL, 60)))


@st.composite
def random_functions(draw):
    """Functions of three arguments with a random graph of all operations."""
    # what copysign makes of a NaN depends on a sign that no one promises
    operations = [*UNARY.items(), *[item for item in BINARY.items() if item[0] != "copysign"]]
    a, b, c = ca.SX.sym("a", 2), ca.SX.sym("b", 2, 2), ca.SX.sym("c")
    values = [*ca.vertsplit(a), *ca.vertsplit(ca.vec(b)), c]
    values += [ca.SX(draw(st.sampled_from(SPECIAL[:-2]))) for _ in range(2)]
    for _ in range(draw(st.integers(1, 60))):
        name, (build, _reference) = draw(st.sampled_from(operations))
        pick = st.integers(max(0, len(values) - 12), len(values) - 1)
        operands = [values[draw(pick)] for _ in range(2 if name in BINARY else 1)]
        values.append(ca.SX(build(*operands)))
    results = [ca.densify(ca.vertcat(*values[-3:])), ca.densify(ca.vertcat(*values[::5]))]
    return ca.Function("f", [a, b, c], results)


@settings(max_examples=150, deadline=None)
@given(random_functions(), st.lists(st.sampled_from([*SPECIAL, *TAME]), min_size=7, max_size=7))
def test_random_functions(function, values):
    assert_same_bits(*both(function, values[:2], values[2:6], values[6]))


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3))
def test_nothing_is_fused(values):
    x, y, z = (ca.SX.sym(name) for name in "xyz")
    function = ca.Function("f", [x, y, z], [x * y + z, x * y - z * x])
    actual, _ = both(function, *values)
    a, b, c = values
    assert actual.tolist() == [a * b + c, a * b - c * a]


def test_sparse_and_several_results():
    x = ca.SX.sym("x", ca.Sparsity.lower(3))
    function = ca.Function("f", [x, ca.SX.sym("unused", 2)], [x @ x, 3.5, ca.SX(0, 1), ca.sin(x)])
    assert_same_bits(*both(function, np.arange(6.0), [1.0, 2.0]))


def test_result_may_be_the_argument():
    x = ca.SX.sym("x", 3)
    code = compiled(ca.Function("f", [x], [2.0 * x + 1.0]))
    block = np.array([1.0, 2.0, 3.0])
    evaluate = code.bind([block], [block])
    evaluate()
    evaluate()
    np.testing.assert_array_equal(block, [7.0, 11.0, 15.0])


def test_same_content_is_compiled_once():
    def build(factor):
        x = ca.SX.sym("x")
        return ca.Function("f", [x], [ca.sin(factor * x)])

    assert compiled(build(3.0)) is compiled(build(3.0))
    assert compiled(build(3.0)) is not compiled(build(4.0))


def test_callable_keeps_code_and_arrays_alive(monkeypatch):
    pytest.importorskip("llvmlite")
    monkeypatch.setattr(module, "_compiled", {})
    x = ca.SX.sym("x", 50_000)
    result = np.zeros(1)
    evaluate = native_code(ca.Function("f", [x[:2]], [x[0] + x[1]])).bind([np.ones(2)], [result])
    module._compiled.clear()
    gc.collect()
    trash = [np.full(2, np.nan) for _ in range(100)]
    evaluate()
    assert result[0] == 2.0
    assert len(trash) == 100


def test_unknown_operation_is_left_to_the_interpreter():
    x = ca.SX.sym("x")
    assert translate(ca.Function("f", [x], [ca.erfinv(x)])) is None
    assert native_code(ca.Function("f", [x], [ca.erfinv(x)])) is None


def test_matrix_functions_are_left_to_the_interpreter():
    x = ca.MX.sym("x", 2)
    assert native_code(ca.Function("f", [x], [ca.sin(x)])) is None


def test_huge_functions_are_left_to_the_interpreter(monkeypatch):
    monkeypatch.setattr(module, "_MOST_INSTRUCTIONS", 10)
    x = ca.SX.sym("x", 10)
    assert native_code(ca.Function("f", [x], [ca.sin(x)])) is None


def test_without_llvmlite(monkeypatch):
    monkeypatch.setattr(module, "_compiled", {})
    module._llvm.cache_clear()
    for name in ("llvmlite", "llvmlite.binding"):
        monkeypatch.setitem(sys.modules, name, None)
    x = ca.SX.sym("x")
    assert native_code(ca.Function("f", [x], [ca.sin(x)])) is None


def test_failure_of_the_compiler_is_not_an_error(monkeypatch):
    def fail(*_):
        raise AttributeError("create_mcjit_compiler")

    monkeypatch.setattr(module, "_compiled", {})
    monkeypatch.setattr(module, "NativeCode", fail)
    x = ca.SX.sym("x")
    assert native_code(ca.Function("f", [x], [ca.sin(x)])) is None
