"""Statistics of the imperfections of a measurement."""

import numpy as np
import pytest

from identification.measurement.imperfections import Imperfections, shipped_imperfections
from pfsc_drake.errors import InputError

NOISE = np.array([2.0, 0.5])


def test_the_disturbance_has_the_stated_size_and_memory():
    faults = Imperfections(NOISE, np.zeros(2), disturbance=0.2, disturbance_time=0.1)
    w = faults.coloured_torque(200_000, 1e-3, np.random.default_rng(0))
    np.testing.assert_allclose(np.std(w, axis=0), 0.2 * NOISE, rtol=0.1)
    # correlation falls to 1 / e after the correlation time
    correlation = np.sum(w[100:] * w[:-100], axis=0) / np.sum(w**2, axis=0)
    np.testing.assert_allclose(correlation, np.exp(-1.0), atol=0.1)
    starts = [
        faults.coloured_torque(2, 1e-3, np.random.default_rng(k))[0] / NOISE for k in range(500)
    ]
    np.testing.assert_allclose(np.std(starts, axis=0), 0.2, rtol=0.15)


def test_friction_scatters_as_stated():
    faults = Imperfections(NOISE, np.zeros(2)).realistic()
    random = np.random.default_rng(1)
    runs = np.array(
        [faults.friction(np.full(2, 10.0), np.full(2, 3.0), random) for _ in range(900)]
    )
    np.testing.assert_allclose(runs.mean(axis=0), [[10.0, 10.0], [3.0, 3.0]], rtol=0.01)
    np.testing.assert_allclose(runs[:, 0].std(axis=0), 0.25, rtol=0.1)
    np.testing.assert_allclose(runs[:, 1].std(axis=0), 0.18, rtol=0.1)
    exact = Imperfections(NOISE, np.zeros(2)).friction(np.ones(2), np.ones(2), random)
    np.testing.assert_array_equal(exact, np.ones((2, 2)))


def test_shipped_noise_is_that_of_the_table():
    faults = shipped_imperfections("comau_racer_1_4")
    np.testing.assert_allclose(faults.torque_noise, [12.6, 11.6, 6.22, 0.71, 0.5, 0.28])
    assert faults.disturbance == 0.0
    with pytest.raises(InputError, match="allowed: noise of your own, or a robot of comau_racer"):
        shipped_imperfections("../comau_racer_1_4")


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"disturbance": -1.0}, "disturbance = -1"),
        ({"position_noise": np.nan}, "position_noise = nan"),
        ({"disturbance_time": 0.0}, "disturbance_time = 0"),
        ({"coulomb_spread": np.inf}, "coulomb_spread = inf"),
    ],
)
def test_bad_values(option, message):
    with pytest.raises(InputError, match=message):
        Imperfections(NOISE, np.zeros(2), **option)


def test_imperfections_of_another_robot():
    with pytest.raises(InputError, match="torque_noise: 2 values; the robot has 3 joints"):
        Imperfections(NOISE, np.zeros(2)).check_size(3)
