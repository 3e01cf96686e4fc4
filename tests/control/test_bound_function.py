"""The bound function against an ordinary call of the same function."""

import casadi as ca
import numpy as np

from pfsc_drake.control.bound_function import BoundFunction

A, B = ca.SX.sym("A", 2, 3), ca.SX.sym("b", 3)
FUNCTION = ca.Function("f", [A, B], [A @ B, ca.sin(A)], ["A", "b"], ["product", "sine"])


def test_values_by_columns():
    bound = BoundFunction(FUNCTION)
    rng = np.random.default_rng(0)
    for _ in range(2):
        a, b = rng.standard_normal((2, 3)), rng.standard_normal(3)
        bound.arguments["A"][:], bound.arguments["b"][:] = a.ravel(order="F"), b
        bound.evaluate()
        np.testing.assert_allclose(bound.results["product"], a @ b, rtol=1e-15)
        np.testing.assert_allclose(bound.results["sine"], np.sin(a).ravel(order="F"), rtol=1e-15)


def test_shared_arrays_need_no_copy():
    block = np.zeros(5)
    first = BoundFunction(FUNCTION, b=block[:3], product=block[3:])
    second = BoundFunction(FUNCTION, b=block[:3])
    block[:3] = 1.0, 2.0, 3.0
    first.arguments["A"][:] = second.arguments["A"][:] = 1.0
    first.evaluate()
    second.evaluate()
    np.testing.assert_array_equal(block[3:], [6.0, 6.0])
    np.testing.assert_array_equal(second.results["product"], [6.0, 6.0])
