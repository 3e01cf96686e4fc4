"""Against points of mass, and the moments of inertia of what they make up."""

import numpy as np
import pytest

from identification.consistency.pseudo_inertia import (
    distance,
    from_pseudo_inertia,
    linear_terms,
    pseudo_inertia,
    spread,
)
from identification.model.dynamic_parameters import link_parameters


def cloud(seed, points=12):
    """Return points of mass."""
    random = np.random.default_rng(seed)
    return random.uniform(0.1, 1.0, points), random.normal(0.3, [0.1, 0.2, 0.4], (points, 3))


def parameters_of(masses, positions):
    inertia = sum(
        m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, positions, strict=True)
    )
    return link_parameters(masses.sum(), masses @ positions / masses.sum(), inertia)


@pytest.mark.parametrize("seed", range(3))
def test_moments_of_points(seed):
    masses, positions = cloud(seed)
    points = np.column_stack([positions, np.ones(len(positions))])
    parameters = parameters_of(masses, positions)
    P = pseudo_inertia(parameters)
    np.testing.assert_allclose(P, (points.T * masses) @ points, rtol=1e-12)
    np.testing.assert_allclose(from_pseudo_inertia(P), parameters, rtol=1e-12)
    np.testing.assert_allclose(np.tensordot(parameters, linear_terms(), 1), P, rtol=1e-12)


@pytest.mark.parametrize("seed", range(40))
def test_positive_just_where_mass_and_moments_of_inertia_are_physical(seed):
    random = np.random.default_rng(seed)
    mass, center = random.uniform(-0.3, 2.0), random.normal(size=3)
    turned = np.linalg.qr(random.normal(size=(3, 3)))[0]
    principal = random.uniform(-0.2, 1.0, 3)
    central = turned @ np.diag(principal) @ turned.T
    inertia = central + mass * (center @ center * np.eye(3) - np.outer(center, center))
    least = np.linalg.eigvalsh(pseudo_inertia(link_parameters(mass, center, inertia)))[0]
    low, middle, high = np.sort(principal)
    assert (least > 0.0) == (mass > 0.0 and low > 0.0 and high < low + middle)


def test_spread_of_a_ball_and_of_nothing_real():
    radius, center = 0.2, np.array([1.0, -2.0, 0.5])
    ball = 0.4 * 3.0 * radius**2 * np.eye(3)
    about_origin = ball + 3.0 * (center @ center * np.eye(3) - np.outer(center, center))
    parameters = link_parameters(3.0, center, about_origin)
    np.testing.assert_allclose(spread(parameters), radius / np.sqrt(5.0), rtol=1e-9)
    parameters[[4, 7, 9]] -= 0.5 * about_origin.trace()
    assert np.isnan(spread(parameters)[0])


def test_distance_is_zero_for_equals_and_independent_of_the_frame():
    one, other = (pseudo_inertia(parameters_of(*cloud(seed))) for seed in (5, 6))
    assert distance(one, one) == pytest.approx(0.0, abs=1e-12)
    assert distance(2.0 * one, one) == pytest.approx(2.0)
    near = one + 1e-4 * other
    ratio = np.linalg.solve(one, near)
    entropy = np.trace(ratio) - np.linalg.slogdet(ratio)[1] - 4.0
    assert distance(near, one) == pytest.approx(entropy, rel=1e-2)
    frame = np.random.default_rng(7).normal(size=(4, 4))
    frame[3] = [0.0, 0.0, 0.0, 1.0]
    transform_parameters = distance(frame @ other @ frame.T, frame @ one @ frame.T)
    assert transform_parameters == pytest.approx(distance(other, one), rel=1e-9)
