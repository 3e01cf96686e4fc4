"""Warnings about forces that the law of a station does not receive."""

from pathlib import Path

import pytest

from diagrams.builder import build_station
from diagrams.scenario import ForcePulse, GainParameters, LawGains, Scenario
from diagrams.scenario.model_error import ModelErrorParameters
from diagrams.station_warnings import expected_forces
from pfsc_drake.physics.hand_model import HandParameters
from tests.scenarios import shipped_scenario

SCENARIOS = Path(__file__).resolve().parents[3] / "experiments" / "scenarios"


@pytest.fixture(name="scenario")
def fixture_scenario():
    """A hand leads six axes without friction, under a law for torques."""
    scenario = shipped_scenario("vf_forbidden_region")
    poles = GainParameters(poles=[-60.0, -60.0])
    scenario.controller.law = "rigid"
    scenario.controller.gains["rigid"] = LawGains(eta=poles, phi=poles)
    scenario.friction.file, scenario.model_error = "", ModelErrorParameters()
    return scenario


def force_warnings(scenario):
    return [line for line in build_station(scenario, SCENARIOS).warnings if "forces act" in line]


@pytest.mark.slow
def test_measured_forces_servos_and_soft_regions_need_no_warning(scenario):
    (line,) = force_warnings(scenario)
    assert "45 N" in line and "fixtures.bound = 0.5 mm" in line and "'measured'" in line
    for law, source in (("velocity_servo", "none"), ("rigid", "measured")):
        scenario.controller.law, scenario.controller.external_torque.source = law, source
        assert force_warnings(scenario) == []
    scenario.controller.external_torque.source = "none"
    for region in scenario.fixtures.regions:
        region.stiffness = 1e4
    assert force_warnings(scenario) == []


@pytest.mark.slow
def test_friction_that_is_not_compensated_takes_a_tool_into_hard_regions(scenario):
    """1.3 mm with an unmodelled hand, 0.85 mm with a measured one."""

    def friction():
        return [x for x in build_station(scenario, SCENARIOS).warnings if "compensate fric" in x]

    assert friction() == []
    scenario.friction.file = "comau_racer_1_4"
    (line,) = friction()
    assert "controller.friction.source 'observer'" in line
    scenario.controller.friction.source = "observer"
    assert friction() == []


def test_pulses_that_overlap_add_up_and_those_on_links_do_not_count():
    scenario = Scenario(
        forces=[
            ForcePulse(0.0, 1.0, [3.0, 4.0, 0.0]),
            ForcePulse(0.5, 2.0, [0.0, 0.0, 7.0]),
            ForcePulse(1.0, 2.0, [0.0, 2.0, 0.0]),
            ForcePulse(0.5, 2.0, [0.0, 99.0, 0.0], link="link_2"),
        ]
    )
    assert expected_forces(scenario).tool == pytest.approx(12.0)
    scenario.hand = HandParameters(force_limit=20.0)
    assert expected_forces(scenario).tool == pytest.approx(32.0)
