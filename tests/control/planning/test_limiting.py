"""Active limits of a motion of a few samples."""

import numpy as np
import pytest

from pfsc_drake.control.planning.limiting import Limiting

STEP = 0.5e-3


@pytest.fixture(name="limiting")
def fixture_limiting():
    torques = np.array([[1.0, 0.0], [1.0, 0.2], [1.2, 0.2], [2.0, 0.2], [2.0, 0.2], [2.0, 0.2]])
    speeds = np.array([[0.1, 0.1], [0.1, 0.5], [0.1, 0.1], [0.1, 0.1], [0.1, 0.1], [0.1, 0.1]])
    demand = np.concatenate([torques, speeds], axis=1)
    allowed = np.tile([2.0, 1.0, 0.5, 0.5], (6, 1))
    velocity = np.array([0.0, 0.0, 0.0, 0.0, 0.3, 1.0])
    return Limiting.of(demand, allowed, (2, 2 * STEP), np.array([1e4, 2e2]), velocity)


def test_shares(limiting):
    assert limiting.names == [
        "torque_1",
        "torque_2",
        "speed_1",
        "speed_2",
        "rate_1",
        "rate_2",
        "velocity",
    ]
    assert np.allclose(limiting.shares[:, 0], [0.5, 0.5, 0.6, 1.0, 1.0, 1.0])
    assert np.allclose(limiting.shares[1, 2:4], [0.2, 1.0])
    # from one command to the next, two samples later
    assert np.allclose(limiting.shares[:, 4], np.array([0.2, 1.0, 0.8, 0.0, 0.0, 0.0]) * 1e3 / 1e4)
    assert np.allclose(limiting.shares[:, 5], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert np.allclose(limiting.by_kind.max(axis=1), limiting.largest)
    assert np.allclose(limiting.by_kind[1], [0.5, 1.0, 0.1, 0.0])


def test_active_limits_and_their_shares_of_the_path(limiting):
    assert limiting.active.tolist() == [6, 4, 0, 1, 1, 1]
    parts = limiting.path_shares(np.array([1.0, 1.0, 2.0, 1.0, 2.0, 3.0]))
    assert parts == pytest.approx({"none": 0.2, "torque_1": 0.6, "speed_2": 0.1, "rate_2": 0.1})
