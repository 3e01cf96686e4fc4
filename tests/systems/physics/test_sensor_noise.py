"""Noise of a sensor depends on the tick, not on the order of evaluation."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from pfsc_drake.systems.physics.sensor_noise import SensorNoise

PERIOD, DEVIATION = 1e-3, np.array([0.1, 0.2, 3.0])


def drawn(tick):
    """Return the noise of a tick, drawn in blocks of 64."""
    random = np.random.default_rng((7, tick // 64))
    return DEVIATION * random.standard_normal((64, 3))[tick % 64]


@pytest.mark.parametrize("start", [0, 100])
def test_the_noise_of_a_tick_is_there_before_between_and_after_its_updates(start):
    system = SensorNoise(DEVIATION, 7, PERIOD)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    context.SetTime(start * PERIOD)
    simulator.Initialize()
    for tick in range(start, start + 300):
        for part in (0.0, 0.5):
            simulator.AdvanceTo((tick + part) * PERIOD)
            noise = system.get_output_port().Eval(context).reshape(128, 3)
            np.testing.assert_array_equal(noise[tick % 128], drawn(tick))
