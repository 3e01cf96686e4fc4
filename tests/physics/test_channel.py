"""Messages that arrive late, unevenly or not at all."""

import numpy as np
import pytest

from pfsc_drake.blocks.stepper import Stepper
from pfsc_drake.errors import InputError
from pfsc_drake.physics.channel import Channel, ChannelParameters, message_ages

T = 1e-3


def arrivals(parameters, ticks):
    """Number of the message that a channel delivers at each tick; 0 for none yet."""
    stepper = Stepper(Channel(parameters, 2, T))
    return [int(stepper.step(sent=[k + 1.0, -k])["arrived"][0]) for k in range(ticks)]


def test_without_jitter_each_message_takes_its_time():
    assert arrivals(ChannelParameters(0.003), 8) == [0, 0, 0, 1, 2, 3, 4, 5]


def test_nothing_arrives_at_once():
    assert arrivals(ChannelParameters(0.0), 4) == [0, 1, 2, 3]


def test_the_newest_that_has_arrived_is_delivered():
    """Against a list of messages with the same draws."""
    parameters = ChannelParameters(0.004, 0.006, 0.3, seed=5)
    random = np.random.default_rng(5)
    delays = np.maximum(1, 4 + random.integers(0, 6, 8192, endpoint=True))
    arrives = random.uniform(size=8192) >= 0.3
    ticks = 300
    expected = []
    for now in range(ticks):
        here = [s for s in range(now + 1) if arrives[s] and s + delays[s] <= now]
        expected.append(max(here) + 1 if here else 0)
    assert arrivals(parameters, ticks) == expected
    assert (np.diff(expected) >= 0).all()


def test_ages_tell_delay_jitter_and_loss():
    ages = message_ages(ChannelParameters(0.1, 0.02, 0.5, seed=2), T)
    assert ages.min() >= 100
    assert 100 < ages.mean() < 115
    assert (message_ages(ChannelParameters(0.1), T) == 100).all()
    other = message_ages(ChannelParameters(0.1, 0.02, 0.5, seed=3), T)
    assert (other != ages).any()


@pytest.mark.parametrize(
    "wrong", [{"delay": -0.1}, {"delay": 3.0}, {"jitter": np.nan}, {"loss": 1.0}, {"seed": -1}]
)
def test_wrong_channels_are_refused(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        ChannelParameters(**wrong)
