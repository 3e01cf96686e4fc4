"""Jets against repeated symbolic differentiation of the same expressions."""

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pfsc_drake import jets
from pfsc_drake.jets import Jet

ORDER = 5
coefficient = st.floats(-2.0, 2.0, allow_nan=False, width=32)
positive = st.floats(0.5, 3.0, allow_nan=False, width=32)
scalar = arrays(float, ORDER + 1, elements=coefficient)
two_scalars = arrays(float, (2, ORDER + 1), elements=coefficient)
two_vectors = arrays(float, (2, ORDER + 1, 3), elements=coefficient)


def polynomial(coefficients, t):
    """The signal whose Taylor coefficients at 0 are given, as an expression in t."""
    return sum((float(c) * t**k for k, c in enumerate(coefficients)), start=ca.SX(0))


def vector_polynomial(coefficients, t):
    return ca.vertcat(*[polynomial(column, t) for column in coefficients.T])


def derivatives_at_zero(expression, t):
    """f, f', ..., f^(ORDER) at t = 0 by repeated symbolic differentiation."""
    values = []
    for _ in range(ORDER + 1):
        values.append(np.array(ca.Function("f", [t], [expression])(0.0)).squeeze())
        expression = ca.jacobian(ca.vec(expression), t).reshape(expression.shape)
    return values


def assert_agrees(jet, expression, t, tolerance=1e-9):
    expected = derivatives_at_zero(expression, t)
    assert jet.order == ORDER
    for value, reference in zip(jet.derivatives(), expected, strict=True):
        scale = max(1.0, float(np.max(np.abs(reference))))
        assert np.max(np.abs(np.squeeze(value) - reference)) <= tolerance * scale


SCALAR_CASES = {
    "sin": (jets.sin, ca.sin),
    "cos": (jets.cos, ca.cos),
    "square": (lambda x: x**2, lambda x: x**2),
    "cube": (lambda x: x**3, lambda x: x * x * x),
    "zeroth power": (lambda x: x**0 + x, lambda x: 1 + x),
    "affine": (lambda x: 2.0 - 3.0 * x + x / 4.0 - 1.0, lambda x: 1.0 - 2.75 * x),
}
POSITIVE_CASES = {
    "sqrt": (jets.sqrt, ca.sqrt),
    "inverse": (lambda x: 1.0 / x, lambda x: 1.0 / x),
    "real power": (lambda x: x**1.7, lambda x: x**1.7),
    "negative power": (lambda x: x**-2, lambda x: 1 / (x * x)),
}


@pytest.mark.parametrize("name", SCALAR_CASES)
@given(c=scalar)
@settings(max_examples=25, deadline=None)
def test_scalar_functions(name, c):
    t = ca.SX.sym("t")
    of_jet, of_expression = SCALAR_CASES[name]
    assert_agrees(of_jet(Jet(list(c))), of_expression(polynomial(c, t)), t)


@pytest.mark.parametrize("name", POSITIVE_CASES)
@given(c=scalar, value=positive)
@settings(max_examples=25, deadline=None)
def test_functions_of_positive_signals(name, c, value):
    c = np.array([value, *c[1:]])
    t = ca.SX.sym("t")
    of_jet, of_expression = POSITIVE_CASES[name]
    assert_agrees(of_jet(Jet(list(c))), of_expression(polynomial(c, t)), t)


@given(c=two_scalars)
@settings(max_examples=25, deadline=None)
def test_products_and_sums_of_signals(c):
    t = ca.SX.sym("t")
    x, y = Jet(list(c[0])), Jet(list(c[1]))
    fx, fy = polynomial(c[0], t), polynomial(c[1], t)
    assert_agrees(x * y + x - y, fx * fy + fx - fy, t)


@given(c=two_scalars, value=positive)
@settings(max_examples=25, deadline=None)
def test_quotient_and_angle(c, value):
    c[1, 0] = value
    t = ca.SX.sym("t")
    x, y = Jet(list(c[0])), Jet(list(c[1]))
    fx, fy = polynomial(c[0], t), polynomial(c[1], t)
    assert_agrees(x / y, fx / fy, t)
    assert_agrees(jets.atan2(x, y), ca.atan2(fx, fy), t)
    assert_agrees(jets.atan2(-y, x), ca.atan2(-fy, fx), t)


@given(c=two_vectors)
@settings(max_examples=25, deadline=None)
def test_vector_products(c):
    t = ca.SX.sym("t")
    x, y = Jet(list(c[0])), Jet(list(c[1]))
    fx, fy = vector_polynomial(c[0], t), vector_polynomial(c[1], t)
    assert_agrees(jets.dot(x, y), ca.dot(fx, fy), t)
    assert_agrees(jets.cross(x, y), ca.cross(fx, fy), t)
    assert_agrees(jets.cross(c[0, 0], y), ca.cross(ca.DM(c[0, 0]), fy), t)
    assert_agrees(jets.dot(x, c[1, 0]), ca.dot(fx, ca.DM(c[1, 0])), t)


@given(c=arrays(float, (2, ORDER + 1, 3, 3), elements=coefficient))
@settings(max_examples=20, deadline=None)
def test_matrix_products(c):
    t = ca.SX.sym("t")
    x, y = Jet(list(c[0])), Jet(list(c[1]))
    fx, fy = (sum((ca.DM(m) * t**k for k, m in enumerate(cs)), start=ca.SX(3, 3)) for cs in c)
    assert_agrees(x @ y, fx @ fy, t)
    assert_agrees(c[0, 0] @ y.T, ca.DM(c[0, 0]) @ fy.T, t)
    assert_agrees(x @ c[1, 0, 0], fx @ ca.DM(c[1, 0, 0]), t)
    assert_agrees(x[0, 1] * y[2, 2], fx[0, 1] * fy[2, 2], t)


@given(inner=scalar)
@settings(max_examples=25, deadline=None)
def test_composition_from_derivatives(inner):
    s, t = ca.SX.sym("s"), ca.SX.sym("t")
    outer = ca.vertcat(ca.sin(2 * s), ca.exp(-s), s**7)
    expression, derivatives = outer, []
    for _ in range(ORDER + 1):
        derivatives.append(np.array(ca.Function("f", [s], [expression])(inner[0])).squeeze())
        expression = ca.jacobian(expression, s)
    composed = ca.substitute(outer, s, polynomial(inner, t))
    assert_agrees(jets.compose(derivatives, Jet(list(inner))), composed, t)


@given(inner=two_scalars)
@settings(max_examples=15, deadline=None)
def test_composition_from_partial_derivatives(inner):
    t = ca.SX.sym("t")
    a, b = (float(x) for x in inner[:, 0])
    g, h = (polynomial(x, t) for x in inner)
    # closed forms: f = exp(-a) sin(2 b) and f = (a + 2 b)^7
    orders = [(n - j, j) for n in range(ORDER + 1) for j in range(n + 1)]
    waves = [np.sin(2 * b + j * np.pi / 2) * 2**j * (-1) ** i * np.exp(-a) for i, j in orders]
    powers = [math.perm(7, i + j) * (a + 2 * b) ** (7 - i - j) * 2**j for i, j in orders]
    composed = ca.vertcat(ca.exp(-g) * ca.sin(2 * h), (g + 2 * h) ** 7)
    partials, pair = list(np.array([waves, powers]).T), [Jet(list(x)) for x in inner]
    jet = jets.compose_pair(partials, *pair)
    assert_agrees(jet, composed, t)
    # the order is the lowest of all
    for order in range(ORDER + 1):
        known = partials[: (order + 1) * (order + 2) // 2]
        assert jets.compose_pair(known, *pair).order == order
        assert jets.compose_pair(partials, pair[0], pair[1].truncate(order)).order == order
    part = jets.compose_pair(partials, pair[0].truncate(2), pair[1])
    assert np.allclose(part.coefficients, jet.coefficients[:3], rtol=1e-15)


@given(c=scalar)
@settings(max_examples=20, deadline=None)
def test_differentiation_inverts_integration(c):
    x = Jet(list(c))
    back = x.integrate(3.0).differentiate()
    assert np.allclose(back.coefficients, x.coefficients, rtol=1e-15, atol=0)
    assert x.integrate(3.0).coefficients[0] == 3.0
    assert np.isclose(x.differentiate().derivative(3), x.derivative(4))


@given(c=two_vectors)
@settings(max_examples=15, deadline=None)
def test_symbolic_and_numeric_jets_agree(c):
    def expression(x, y):
        n = jets.sqrt(jets.dot(x, x) + 1.0)
        return jets.atan2(jets.dot(x, y), n) + jets.sin(jets.cross(x, y)[2] / n)

    symbols = [ca.SX.sym("c", 3) for _ in range(2 * (ORDER + 1))]
    symbolic = expression(Jet(symbols[: ORDER + 1]), Jet(symbols[ORDER + 1 :]))
    f = ca.Function("f", symbols, [ca.vertcat(*symbolic.coefficients)])
    numeric = expression(Jet(list(c[0])), Jet(list(c[1])))
    values = np.array(f(*c.reshape(-1, 3))).squeeze()
    scale = np.maximum(1.0, np.abs(numeric.coefficients))
    assert np.max(np.abs(values - numeric.coefficients) / scale) < 1e-9


def test_ode_solution_matches_closed_form():
    # x' = -x^2, x(0) = 2  =>  x = 2 / (1 + 2 t)
    solution = jets.solve_ode(lambda x: -(x * x), 2.0, ORDER)
    expected = [2.0 * (-2.0) ** k for k in range(ORDER + 1)]
    assert np.allclose(solution.coefficients, expected, rtol=1e-14)


def test_order_of_mixed_operands_is_what_is_known():
    x, y = Jet([1.0, 2.0, 3.0]), Jet([1.0, 1.0])
    assert (x * y).order == (x + y).order == (x / y).order == 1
    assert x.truncate(1).derivatives() == [1.0, 2.0]
    assert x.derivatives() == [1.0, 2.0, 6.0]
    assert jets.vector([x, y]).order == 1


def test_derivatives_and_coefficients_are_inverse():
    values = [0.3, -1.0, 4.0, 0.5]
    assert np.allclose(Jet.from_derivatives(values).derivatives(), values)
    assert Jet.from_derivatives(values).coefficients[3] == pytest.approx(0.5 / math.factorial(3))


def test_an_empty_jet_is_refused():
    with pytest.raises(ValueError, match="order 0"):
        Jet([])
