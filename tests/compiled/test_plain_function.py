"""Functions of plain floats beside the functions that they are made of."""

import casadi as ca
import numpy as np
import pytest

from pfsc_drake.compiled.bound_function import PlainFunction


@pytest.mark.parametrize("symbol", [ca.SX, ca.MX])
def test_it_takes_and_returns_all_elements(symbol):
    point, time = symbol.sym("point", 2), symbol.sym("time")
    function = ca.Function("f", [point, time], [point * time, ca.sin(time), 2.0 * point[0]])
    plain = PlainFunction(function)
    first = plain(3.0, -1.0, 0.5)
    assert first == (1.5, -0.5, np.sin(0.5), 6.0)
    assert all(type(value) is float for value in first)
    plain(0.0, 0.0, 0.0)
    assert first[0] == 1.5
