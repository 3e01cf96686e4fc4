"""Friction of known coefficients, against (2.41) away from rest."""

import numpy as np
import pytest

from pfsc_drake.control.estimation.friction_model import friction_model_function
from pfsc_drake.errors import InputError

F_C, F_V = np.array([12.0, 0.0, 5.0]), np.array([6.0, 9.0, 0.0])


def test_is_coulomb_and_viscous_friction_away_from_rest():
    v = np.array([0.5, -0.3, -0.8])
    tau = np.array(friction_model_function(F_C, F_V, 0.01)(v)).ravel()
    np.testing.assert_allclose(tau, F_C * np.sign(v) + F_V * v, rtol=1e-12)


def test_is_smooth_and_odd_at_rest():
    function, v = friction_model_function(F_C, F_V, 0.01), np.array([1e-6, -2e-6, 3e-6])
    forth, back = (np.array(function(sign * v)).ravel() for sign in (1.0, -1.0))
    np.testing.assert_allclose(forth, (F_C / 0.01 + F_V) * v, rtol=1e-6)
    assert np.array_equal(forth, -back)


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
        friction_model_function(*arguments)
