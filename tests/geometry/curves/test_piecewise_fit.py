"""Adaptive polynomial pieces."""

import numpy as np
import pytest

from pfsc_drake.errors import InputError
from pfsc_drake.geometry.curves.piecewise_fit import chebyshev_nodes, fit_pieces, power_coefficients


def test_power_coefficients_reproduce_a_polynomial() -> None:
    starts, lengths = np.array([0.0, 2.0]), np.array([2.0, 0.01])
    polynomial = np.polynomial.Polynomial([1.0, -2.0, 0.5, 0.25, 0.1])
    nodes = chebyshev_nodes(starts, lengths, 5)
    found = power_coefficients(polynomial(nodes)[..., None], lengths)
    np.testing.assert_allclose(found[0, :, 0], polynomial.coef, atol=1e-13)
    local = 0.007
    value = found[1, :, 0] @ local ** np.arange(5)
    assert value == pytest.approx(polynomial(2.0 + local), abs=1e-13)


def test_fit_keeps_its_tolerance_across_jumps() -> None:
    def function(theta: np.ndarray) -> np.ndarray:
        return np.stack([np.exp(np.sin(3 * theta)), np.where(theta < 1.0, theta, -theta)], axis=1)

    breaks, table = fit_pieces(function, np.array([0.0, 1.0, 2.0]), degree=6, tolerance=1e-9)
    assert 1.0 in breaks
    theta = np.random.default_rng(0).uniform(0, 2, 2000)
    piece = np.searchsorted(breaks, theta, side="right") - 1
    powers = (theta - breaks[piece])[:, None] ** np.arange(7)
    values = np.einsum("nj,njd->nd", powers, table[piece])
    np.testing.assert_allclose(values, function(theta), atol=3e-9)


def test_jumps_inside_a_segment_are_refused() -> None:
    with pytest.raises(InputError, match=r"not smooth near theta = 0\.3"):
        fit_pieces(
            lambda x: np.where(x < 1 / 3, 0.0, 1.0)[:, None],
            np.array([0.0, 1.0]),
            degree=6,
            tolerance=1e-9,
        )


@pytest.mark.slow
def test_roughness_everywhere_is_refused_before_the_memory_ends() -> None:
    with pytest.raises(InputError, match=r"more than \d+ polynomials .* near theta = 0 "):
        fit_pieces(
            lambda x: np.sin(1e9 * x)[:, None], np.array([0.0, 1.0]), degree=6, tolerance=1e-9
        )
