"""A short lap for tests of what others would take."""

import pytest

from experiments.studies.peers.lap import Lap


@pytest.fixture(scope="module")
def lap():
    return Lap(duration=0.1)


@pytest.fixture(scope="module")
def station(lap):
    return lap.station
