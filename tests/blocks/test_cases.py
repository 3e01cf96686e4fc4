"""Cases as expressions: on numbers, SX and MX, with NaN where it does not matter."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.blocks import cases

NAN, INF = np.nan, np.inf


def on_numbers(function, *arguments):
    return np.array(ca.DM(function(*[ca.DM(x) for x in arguments]))).ravel()


def compiled(kind):
    def evaluate(function, *arguments):
        symbols = [kind.sym(f"x{i}", np.size(x)) for i, x in enumerate(arguments)]
        return np.array(ca.Function("f", symbols, [function(*symbols)])(*arguments)).ravel()

    return evaluate


@pytest.fixture(name="evaluate", params=["numbers", "SX", "MX"])
def fixture_evaluate(request):
    return {"numbers": on_numbers, "SX": compiled(ca.SX), "MX": compiled(ca.MX)}[request.param]


def test_a_value_by_its_condition(evaluate):
    found = evaluate(cases.where, [1.0, 0.0, 1.0], [1.0, NAN, INF], [NAN, 2.0, NAN])
    assert found.tolist() == [1.0, 2.0, INF]
    assert evaluate(lambda c: cases.where(c, 5.0, -5.0), [0.0, 1.0]).tolist() == [-5.0, 5.0]


@pytest.mark.parametrize(("x", "sign"), [(-3.0, -1.0), (0.0, 0.0), (4.0, 1.0), (NAN, 0.0)])
def test_the_first_case_that_holds(evaluate, x, sign):
    def of(x):
        return cases.first_of((x < 0.0, -1), (x > 0.0, 1), (x > 1.0, 99), otherwise=0)

    assert evaluate(of, [x]).tolist() == [sign]


def test_no_case_at_all():
    assert cases.first_of(otherwise=7) == 7


def test_the_first_that_is_found_stays(evaluate):
    assert evaluate(cases.latch, [0.0, 0.0, 4.0, 4.0], [0.0, 3.0, 0.0, 5.0]).tolist() == [
        0,
        3,
        4,
        4,
    ]


@pytest.mark.parametrize("flags", [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [-1.0, 1.0], [0.0, NAN]])
def test_some_and_all_conditions(evaluate, flags):
    parts = (flags, [1.0])
    assert evaluate(cases.any_of, flags)[0] == np.any(flags)
    assert evaluate(cases.all_of, flags)[0] == np.all(flags)
    assert evaluate(cases.any_of, *parts)[0] == 1.0
    assert evaluate(cases.all_of, *parts)[0] == np.all(flags)


@pytest.mark.parametrize("bad", [NAN, INF, -INF])
def test_what_is_finite(evaluate, bad):
    assert evaluate(cases.is_finite, [1.0, bad, -1e308]).tolist() == [1.0, 0.0, 1.0]
    assert evaluate(cases.all_finite, [1.0, -1e308], [2.0]).tolist() == [1.0]
    assert evaluate(cases.all_finite, [1.0, 2.0], [bad]).tolist() == [0.0]
    assert evaluate(cases.all_finite, [bad, -bad], [1.0]).tolist() == [0.0]


def test_the_least_of_those_that_count(evaluate):
    values = [3.0, 1.0, NAN, 1.0, -5.0]
    assert evaluate(cases.least, values, [1.0, 1.0, 1.0, 1.0, 0.0])[0] == 1
    assert evaluate(cases.least, values, [1.0, 0.0, 1.0, 0.0, 0.0])[0] == 0
    assert evaluate(cases.least, values, [0.0, 0.0, 1.0, 0.0, 0.0])[0] == -1


@pytest.mark.parametrize(("which", "expected"), [(1.0, [0, 1, 0]), (-1.0, [0, 0, 0])])
def test_a_one_at_an_index(evaluate, which, expected):
    assert evaluate(lambda k: cases.unit(k, 3), [which]).tolist() == expected
