"""Parameters that artificial columns distinguish or not."""

import numpy as np
import pytest

from identification.estimation.identifiability import factorize
from pfsc_drake.errors import InputError

NAMES = ["a", "b", "c", "d", "e"]


@pytest.fixture
def columns():
    return np.random.default_rng(0).normal(size=(40, 5)) * [1.0, 1e3, 1e-4, 1.0, 1.0]


def test_solution_of_independent_columns(columns):
    x = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    factors = factorize(columns, columns @ x, NAMES, "robot")
    np.testing.assert_allclose(factors.solution(), x)
    np.testing.assert_allclose(factors.inverse(), np.linalg.inv(columns.T @ columns))
    assert factors.condition < 5.0  # whatever the units


def test_column_of_zeros(columns):
    columns[:, 2] = 0.0
    with pytest.raises(InputError, match="without effect on the torques: c; must move"):
        factorize(columns, columns[:, 0], NAMES, "robot")


def test_columns_that_depend_on_each_other(columns):
    columns[:, 3] = 2.0 * columns[:, 0] - 1e4 * columns[:, 2]
    columns[:, 4] = 1e-3 * columns[:, 1]
    with pytest.raises(InputError, match=r"^robot.*cannot be distinguished: a, c, d; b, e; must"):
        factorize(columns, columns[:, 0], NAMES, "robot")


def test_fewer_rows_than_parameters(columns):
    with pytest.raises(InputError, match=r"\(3 torques count\).*a, b, c, d, e"):
        factorize(columns[:3], columns[:3, 0], NAMES, "robot")

    # a grows as d falls
