"""Operations of functions of scalars: against the interpreter, and against Python's library."""

import math
import operator

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pfsc_drake.compiled import operations
from tests.compiled.interpreter import SPECIAL, assert_same_bits, both

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
            expected_value = reference(value)
        except (ValueError, ZeroDivisionError):
            continue
        assert result == pytest.approx(expected_value, rel=4e-16, abs=0)


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
                expected_value = reference(a, b)
            except (ValueError, ZeroDivisionError):
                continue
            assert actual[0] == pytest.approx(expected_value, rel=4e-16, abs=0)


def test_every_known_operation_is_tested():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    functions = [function_of(build(x), x) for build, _ in UNARY.values()]
    functions += [function_of(build(x, y), x, y) for build, _ in BINARY.values()]
    functions += [function_of(x**2.7, x)]
    used = {f.instruction_id(k) for f in functions for k in range(f.n_instructions())}
    known = {code for code in range(200) if operations.is_known(code)}
    assert known
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


@settings(max_examples=40, deadline=None)
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


def test_unknown_operations_have_names():
    with pytest.raises(operations.Untranslatable, match="operation OP_ERFINV"):
        operations.operation(ca.OP_ERFINV)


@pytest.mark.parametrize("value", [0.0, -0.0, 0.1, -math.inf, 5e-324, 1e308])
def test_literals_have_all_bits(value):
    bits = np.array([int(operations.literal(value), 16)], dtype=np.uint64)
    assert_same_bits(bits.view(float), np.array([value]))
