"""A run that ends before leader and tool rest says so."""

import pytest

from diagrams.warnings.rest_warnings import rest_warnings
from tests.scenarios import shipped_scenario


@pytest.mark.parametrize("name", ["teleop_region", "teleop_path", "teleop_plate", "teleop_tilt"])
def test_shipped_scenarios_come_to_rest(name):
    settings = shipped_scenario(name)
    assert rest_warnings(settings.teleoperation, settings.hand, settings.duration) == []


def test_a_longer_delay_takes_longer():
    settings = shipped_scenario("teleop_region")
    settings.teleoperation.channel.delay = 0.2
    (said,) = rest_warnings(settings.teleoperation, settings.hand, settings.duration)
    assert said.startswith("hand.release = 17.5 s")
    assert "round trips of 0.48 s" in said
    assert "0.3 s are left" in said
    assert rest_warnings(settings.teleoperation, settings.hand, 18.2) == []
    assert rest_warnings(settings.teleoperation, settings.hand, 17.0) == []  # before it lets go
    assert rest_warnings(settings.teleoperation, None, 18.0) == []
    assert rest_warnings(None, settings.hand, 18.0) == []
