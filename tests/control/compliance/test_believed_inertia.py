"""Tolerable errors of masses with observed instead of measured forces."""

import numpy as np
import pytest

from pfsc_drake.control.compliance.tuned_impedance import (
    tolerable_inertia_error,
    tolerable_mass_error,
)


def rates(mass, damping, stiffness, rate, error):
    """Return the modes of ``m y'' + d y' + k y = z``, ``z' = L (error y'' - z)``."""
    accelerating = np.array([-stiffness, -damping, 1.0]) / mass
    observing = rate * error * accelerating - [0.0, 0.0, rate]
    return np.linalg.eigvals([[0.0, 1.0, 0.0], accelerating, observing])


@pytest.mark.parametrize(
    "impedance", [(3.0, 150.0, 5000.0), (0.2, 24.6, 34.4), (3.0, 90.0, 0.0), (10.0, 20.0, 8000.0)]
)
@pytest.mark.parametrize("rate", [20.0, 100.0, 400.0])
def test_the_limit_is_where_the_loop_begins_to_grow(impedance, rate):
    limit = tolerable_inertia_error(*impedance, rate)
    fastest = [rates(*impedance, rate, share * limit).real.max() for share in (0.99, 1.01)]
    assert fastest[0] < 1e-9  # without stiffness the position is neutrally stable
    assert fastest[1] > 1e-3
    if impedance[2]:
        oscillation = np.abs(rates(*impedance, rate, limit).imag).max()
        mass, damping, stiffness = impedance
        assert oscillation == pytest.approx(np.sqrt((stiffness + damping * rate) / mass))


def test_a_rigid_coordinate_tolerates_any_error():
    assert tolerable_inertia_error(3.0, 150.0, np.inf, 100.0) == np.inf
    assert tolerable_mass_error(np.eye(2), np.eye(2), np.array([np.inf, np.inf])) == np.inf


def test_the_mass_of_an_arm_as_a_coordinate_sees_it():
    """Two slides; one coordinate is half of the first, the other is stiff: 4 x 5 kg move it."""
    A, inertia = np.diag([0.5, 1.0]), np.diag([5.0, 7.0])
    assert tolerable_mass_error(inertia, A, np.array([2.0, np.inf])) == pytest.approx(0.1)
    assert tolerable_mass_error(inertia, A, np.array([2.0, 0.14])) == pytest.approx(0.02)
