"""Torques that shake joints."""

import numpy as np
import pytest

from identification.elastic.experiment import zippered_multisine
from pfsc_drake.errors import InputError


def test_joints_share_no_frequency_and_have_the_stated_size():
    rms = np.array([90.0, 8.0, 4.0])
    amplitude, frequency, phase = zippered_multisine(rms, 2.0, np.random.default_rng(0), 4.0, 40.0)
    assert np.unique(frequency).size == frequency.size
    assert frequency.min() == 4.0 and frequency.max() <= 40.0
    t = np.arange(2000) * 1e-3
    tau = np.sum(
        amplitude[..., None] * np.sin(2.0 * np.pi * frequency[..., None] * t + phase[..., None]),
        axis=1,
    )
    np.testing.assert_allclose(np.sqrt(np.mean(tau**2, axis=1)), rms, rtol=1e-9)
    # what one joint does is no part of what another does
    products = tau @ tau.T / t.size
    np.testing.assert_allclose(products, np.diag(rms**2), atol=1e-9 * rms.max() ** 2)


def test_bad_values():
    random = np.random.default_rng(0)
    for rms, period, lowest, message in (
        ([1.0, 0.0], 2.0, 4.0, "rms = .* must be positive"),
        ([1.0], 2.0, 95.0, "95 to 90 Hz"),
        ([1.0] * 6, 0.1, 4.0, "at least 12 are required"),
    ):
        with pytest.raises(InputError, match=message):
            zippered_multisine(np.array(rms), period, random, lowest)
