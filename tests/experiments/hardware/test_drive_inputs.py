"""The joint state between two statuses."""

import numpy as np
import pytest

from experiments.hardware.drive_inputs import state_between


@pytest.mark.parametrize("share", [0.0, 0.3, 0.8, 1.0])
def test_cubic_motions_are_met_exactly(share):
    random, span = np.random.default_rng(1), 0.007
    coefficients = random.normal(size=(4, 2)) / span ** np.arange(4)[:, None]

    def state(time):
        q = sum(c * time**k for k, c in enumerate(coefficients))
        v = sum(k * c * time ** (k - 1) for k, c in enumerate(coefficients) if k)
        return np.concatenate([q, v, q, v])

    found = state_between(state(0.0), state(span), share, span)
    np.testing.assert_allclose(found, state(share * span), rtol=1e-9)
