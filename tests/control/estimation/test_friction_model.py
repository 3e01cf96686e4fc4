"""Friction of known coefficients, against (2.41) away from rest."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.control.estimation.friction_filter import FrictionModel
from pfsc_drake.errors import InputError

F_C, F_V = np.array([12.0, 0.0, 5.0]), np.array([6.0, 9.0, 0.0])


def torque(model, velocity):
    return Stepper(model).step(velocity=velocity)["friction_torque"]


def test_is_coulomb_and_viscous_friction_away_from_rest():
    v = np.array([0.5, -0.3, -0.8])
    tau = torque(FrictionModel(F_C, F_V, 0.01), v)
    np.testing.assert_allclose(tau, F_C * np.sign(v) + F_V * v, rtol=1e-12)


def test_is_smooth_and_odd_at_rest():
    model, v = FrictionModel(F_C, F_V, 0.01), np.array([1e-6, -2e-6, 3e-6])
    forth, back = (torque(model, sign * v) for sign in (1.0, -1.0))
    np.testing.assert_allclose(forth, (F_C / 0.01 + F_V) * v, rtol=1e-6)
    assert np.array_equal(forth, -back)


def test_the_last_velocities_count():
    state = np.arange(12.0) - 9.5
    whole, part = FrictionModel(F_C, F_V, 0.1, 12), FrictionModel(F_C, F_V, 0.1)
    assert np.array_equal(torque(whole, state), torque(part, state[-3:]))


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        ((F_C, F_V[:2], 0.1), "viscous of shape"),
        ((-F_C, F_V, 0.1), "coulomb = "),
        ((F_C, F_V, 0.0), "smoothing = 0"),
        ((F_C, F_V, np.inf), "smoothing = inf"),
    ],
)
def test_refused(arguments, part):
    with pytest.raises(InputError, match=part):
        FrictionModel(*arguments)
