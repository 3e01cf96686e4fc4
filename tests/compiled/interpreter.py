"""Machine code beside CasADi's interpreter."""

import math

import numpy as np

from pfsc_drake.compiled.native_code import native_code, why_not

SPECIAL = [0.0, 1.0, 0.5, 2.0, 3.0, 1e-3, 0.7, math.pi, 1e10, 5e-324, 1e-310, 1e308, math.inf]
SPECIAL = [*SPECIAL, *[-x for x in SPECIAL], math.nan, -math.nan]


def compiled(function):
    code = native_code(function)
    assert code is not None, why_not(function)
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
    """Compare results; the sign of a NaN is left open."""
    is_nan = np.isnan(expected)
    np.testing.assert_array_equal(np.isnan(actual), is_nan)
    np.testing.assert_array_equal(
        actual[~is_nan].view(np.uint64), expected[~is_nan].view(np.uint64)
    )


def assert_agrees(function, rounds=40, seed=0):
    """Compare with the interpreter for numbers of all kinds.

    Some are ordinary, some small integers as indices are, some infinite, zero, or none.
    """
    rng = np.random.default_rng(seed)
    for k in range(rounds):
        values = []
        for i in range(function.n_in()):
            size = function.nnz_in(i)
            ordinary = [rng.normal(size=size), rng.integers(-2, 8, size).astype(float)][k % 2]
            odd = rng.choice(SPECIAL, size)
            values.append(np.where(rng.uniform(size=size) < 0.4 * (k % 3), odd, ordinary))
        assert_same_bits(*both(function, *values))
