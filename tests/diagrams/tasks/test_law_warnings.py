"""What a station warns of."""

from pathlib import Path

import pytest

from diagrams.builder import build_station
from diagrams.scenario import ForcePulse, PathFollowingScenario
from pfsc_drake.physics.hand_model import HandParameters
from pfsc_drake.yaml.typed import load_file

SCENARIOS = Path(__file__).resolve().parents[3] / "experiments" / "scenarios"


@pytest.fixture(name="scenario")
def fixture_scenario():
    return load_file(PathFollowingScenario, SCENARIOS / "pfc_elastic_3r.yaml")


def test_the_shipped_settings_give_no_warning(scenario):
    for law in ("elastic", "singular_perturbation", "rigid"):
        scenario.controller.law = law
        assert build_station(scenario, SCENARIOS).warnings == []


def test_resonances_too_fast_for_the_elastic_law(scenario):
    # 19 Hz times 50 ms is 6 rad
    scenario.controller.sampling_time = 0.05
    (warning,) = build_station(scenario, SCENARIOS).warnings
    assert "Hz" in warning and "singular_perturbation" in warning


def test_damping_too_strong_for_the_sampling(scenario):
    scenario.controller.law = "singular_perturbation"
    # 35000 Nm/rad * 0.3 s * 1 ms / 4.95 kg m^2 = 2.1
    scenario.controller.boundary_layer_damping = [0.3, 0.04, 0.02]
    (warning,) = build_station(scenario, SCENARIOS).warnings
    assert "2.12" in warning and "boundary_layer_damping" in warning


def test_forces_that_the_elastic_law_does_not_know_of(scenario):
    scenario.forces = [ForcePulse(begin=0.1, end=0.5, force=[5.0, 0.0, 0.0])]
    (warning,) = build_station(scenario, SCENARIOS).warnings
    assert "external_torque" in warning
    scenario.controller.external_torque.source = "known"
    assert build_station(scenario, SCENARIOS).warnings == []
    scenario.controller.external_torque.source = "none"
    scenario.controller.law = "singular_perturbation"
    assert build_station(scenario, SCENARIOS).warnings == []


def test_a_hand_that_the_elastic_law_does_not_know_of(scenario):
    scenario.hand = HandParameters()
    (warning,) = build_station(scenario, SCENARIOS).warnings
    assert "external_torque" in warning
